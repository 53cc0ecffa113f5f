/* What the weigher sends. */
#ifndef DEVICE_H
#define DEVICE_H
#include <stdint.h>

#define CHANNELS 4
#define SLOTS    (CHANNELS * 2u)  // both sides

#pragma pack(push, 1)
typedef struct {
    uint8_t  state;
    uint16_t raw[SLOTS];
    float    weight, tare;
    char     name[CHANNELS + 1];
} Weigher;
#pragma pack(pop)

typedef struct { uint8_t id; Weigher weigher; double limit; } Station;
#endif
