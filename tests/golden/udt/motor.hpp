typedef struct { bool on; double speed; } Motor;
