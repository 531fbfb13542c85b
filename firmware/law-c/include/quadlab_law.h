/*
 * quadlab's flight law for programs in C, and for Simulink's C Caller block.
 *
 * Link with libquadlab_law.a: cargo build --release --package law-c
 * Gains: quadlab export --model MODEL --gains GAINS --to c --out quadlab_gains.h
 *
 * The law alone: no arming and no failsafes. SI units; inertial frame north-east-down, body frame front-right-down; Euler angles Z-Y-X.
 * Rotors, seen from above: front left, front right, rear right, rear left.
 */
#ifndef QUADLAB_LAW_H
#define QUADLAB_LAW_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A law: its gains and its memory. Copying it is taking a snapshot. */
typedef struct {
    uint64_t words[256];
} quadlab_law;

/* What comes in with a tick. */
typedef struct {
    float position_m[3];           /* tracked point, inertial */
    float attitude_rad[3];         /* roll, pitch, yaw; yaw on any branch */
    float gyro_rad_s[3];           /* p, q, r; NAN where there is no gyro */
    float battery_v;
    uint32_t position_mode;        /* 0: attitude is commanded; else position */
    float attitude_command_rad[2]; /* roll, pitch; used while attitude is commanded */
    float yaw_command_rad;
    float z_command_m;             /* inertial z, down positive: height is -z */
    float position_command_m[2];   /* inertial x, y; used while position is commanded */
    uint32_t cut_off;              /* 0: fly; else motors at idle, integrators at zero */
    float injection[4];            /* added to each motor command, command units */
} quadlab_inputs;

/* What a function says. */
enum {
    QUADLAB_DONE = 0,
    QUADLAB_NULL = 1,        /* a pointer is null */
    QUADLAB_NO_IMAGE = 2,    /* the gains are no image, a damaged one, or one of another version */
    QUADLAB_NOT_FLYABLE = 3, /* the gains cannot be flown */
    QUADLAB_NOT_STARTED = 4  /* the law was not started */
};

/* Starts a law with gains; whatever was in its memory is gone. */
int32_t quadlab_law_start(quadlab_law *law, const uint8_t *gains, size_t length);

/* Estimators and integrators begin anew with the next tick. */
int32_t quadlab_law_reset(quadlab_law *law);

/* One control period (QUADLAB_SAMPLE_TIME_S of the gains' header): motor commands in command units, always finite and inside the range of
 * the gains. Where it is not QUADLAB_DONE they are zeros. */
int32_t quadlab_law_tick(quadlab_law *law, const quadlab_inputs *inputs, float commands[4]);

#ifdef __cplusplus
}
#endif

#endif
