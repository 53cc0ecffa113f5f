typedef struct WIRE_PACKED {
  uint8_t kind; uint32_t count;
} Head;
MAVPACKED(
typedef struct state_t {
  unsigned char on : 1; unsigned char alarm : 2;
  long number;
}) State;
