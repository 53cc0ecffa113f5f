#define WIRE_PACKED __attribute__((packed))
#define MAVPACKED( one ) one __attribute__((packed))
