/*
 * The flight law as one function of arrays, for Simulink's C Caller block: one law, whose memory is in here.
 *
 * Simulink: Configuration Parameters, Simulation Target, Custom Code: include headers quadlab_block.h; source files quadlab_block.c;
 * libraries libquadlab_law.a. Put a C Caller block with quadlab_block into a subsystem with the sample time QUADLAB_SAMPLE_TIME_S.
 */
#include "quadlab_block.h"

#include "quadlab_gains.h"
#include "quadlab_law.h"

static quadlab_law law;

int32_t quadlab_block(const float measured[10], const float asked[11], float commands[4])
{
    quadlab_inputs inputs;
    int k;
    for (k = 0; k < 3; k++) {
        inputs.position_m[k] = measured[k];
        inputs.attitude_rad[k] = measured[3 + k];
        inputs.gyro_rad_s[k] = measured[6 + k];
    }
    inputs.battery_v = measured[9];
    inputs.position_mode = asked[0] != 0.0f;
    inputs.attitude_command_rad[0] = asked[1];
    inputs.attitude_command_rad[1] = asked[2];
    inputs.yaw_command_rad = asked[3];
    inputs.position_command_m[0] = asked[4];
    inputs.position_command_m[1] = asked[5];
    inputs.z_command_m = asked[6];
    inputs.cut_off = 0;
    for (k = 0; k < 4; k++)
        inputs.injection[k] = asked[7 + k];
    return quadlab_law_tick(&law, &inputs, commands);
}

int32_t quadlab_block_start(void)
{
    return quadlab_law_start(&law, quadlab_gains, sizeof quadlab_gains);
}
