#pragma pack(1)
typedef struct { char a; double b; } T;
