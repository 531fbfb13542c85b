/* The flight law as one function of arrays, for Simulink's C Caller block. */
#ifndef QUADLAB_BLOCK_H
#define QUADLAB_BLOCK_H

#include <stdint.h>

/* To be called once before the first tick: from Configuration Parameters, Custom Code, Initialize function. */
int32_t quadlab_block_start(void);

/* One control period.
 * measured: x, y, z [m], roll, pitch, yaw [rad], p, q, r [rad/s; NAN where there is no gyro], battery [V]
 * asked: 1 for position or 0 for attitude, roll, pitch, yaw [rad], x, y, z [m], four injections [command units]
 * commands: of the motors, command units */
int32_t quadlab_block(const float measured[10], const float asked[11], float commands[4]);

#endif
