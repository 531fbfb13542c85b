//! Rotations between the inertial (NED) and the body (FRD) frame.
//!
//! Quaternions are (w, x, y, z), unit length, and turn body components into inertial ones.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix3, Vector3, Vector4};

/// Direction cosine matrix of (2.2), inertial to body components, from phi, theta, psi in rad.
pub fn dcm_from_euler(euler_rad: Vector3<f64>) -> Matrix3<f64> {
    let (sf, cf) = euler_rad.x.sin_cos();
    let (st, ct) = euler_rad.y.sin_cos();
    let (sp, cp) = euler_rad.z.sin_cos();
    Matrix3::new(
        cp * ct,
        ct * sp,
        -st,
        cp * sf * st - cf * sp,
        cf * cp + sf * sp * st,
        ct * sf,
        sf * sp + cf * cp * st,
        cf * sp * st - cp * sf,
        cf * ct,
    )
}

/// Phi, theta, psi in rad from the direction cosine matrix (inertial to body).
pub fn euler_from_dcm(dcm: &Matrix3<f64>) -> Vector3<f64> {
    Vector3::new(
        dcm[(1, 2)].atan2(dcm[(2, 2)]),
        -dcm[(0, 2)].clamp(-1.0, 1.0).asin(),
        dcm[(0, 1)].atan2(dcm[(0, 0)]),
    )
}

/// Direction cosine matrix (inertial to body) of a unit quaternion (body to inertial).
#[inline(always)]
pub fn dcm_from_quaternion(q: &Vector4<f64>) -> Matrix3<f64> {
    let (w, x, y, z) = (q[0], q[1], q[2], q[3]);
    Matrix3::new(
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y + w * z),
        2.0 * (x * z - w * y),
        2.0 * (x * y - w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z + w * x),
        2.0 * (x * z + w * y),
        2.0 * (y * z - w * x),
        1.0 - 2.0 * (x * x + y * y),
    )
}

/// Unit quaternion (body to inertial) of phi, theta, psi in rad.
pub fn quaternion_from_euler(euler_rad: Vector3<f64>) -> Vector4<f64> {
    let (sf, cf) = (0.5 * euler_rad.x).sin_cos();
    let (st, ct) = (0.5 * euler_rad.y).sin_cos();
    let (sp, cp) = (0.5 * euler_rad.z).sin_cos();
    Vector4::new(
        cf * ct * cp + sf * st * sp,
        sf * ct * cp - cf * st * sp,
        cf * st * cp + sf * ct * sp,
        cf * ct * sp - sf * st * cp,
    )
}

/// Phi, theta, psi in rad of a unit quaternion (body to inertial).
pub fn euler_from_quaternion(q: &Vector4<f64>) -> Vector3<f64> {
    let (w, x, y, z) = (q[0], q[1], q[2], q[3]);
    Vector3::new(
        (2.0 * (y * z + w * x)).atan2(1.0 - 2.0 * (x * x + y * y)),
        (2.0 * (w * y - x * z)).clamp(-1.0, 1.0).asin(),
        (2.0 * (x * y + w * z)).atan2(1.0 - 2.0 * (y * y + z * z)),
    )
}

/// Time derivative of the quaternion for body rates in rad/s: q' = 1/2 q (0, omega).
#[inline(always)]
pub fn quaternion_derivative(q: &Vector4<f64>, rate_rad_s: &Vector3<f64>) -> Vector4<f64> {
    let (w, x, y, z) = (q[0], q[1], q[2], q[3]);
    let (p, qq, r) = (rate_rad_s.x, rate_rad_s.y, rate_rad_s.z);
    Vector4::new(
        0.5 * (-x * p - y * qq - z * r),
        0.5 * (w * p + y * r - z * qq),
        0.5 * (w * qq + z * p - x * r),
        0.5 * (w * r + x * qq - y * p),
    )
}

/// Small body-fixed rotation as a direction cosine matrix: components in a frame turned by `angle_rad` about x, y, z.
pub fn dcm_from_rotation_vector(angle_rad: Vector3<f64>) -> Matrix3<f64> {
    nalgebra::Rotation3::new(-angle_rad).into_inner()
}

/// Euler rates from body rates, (2.3): phi', theta', psi' in rad/s.
pub fn euler_rates_from_body(euler_rad: Vector3<f64>, rate_rad_s: Vector3<f64>) -> Vector3<f64> {
    let (sf, cf) = euler_rad.x.sin_cos();
    let (st, ct) = euler_rad.y.sin_cos();
    let along = rate_rad_s.y * sf + rate_rad_s.z * cf;
    Vector3::new(rate_rad_s.x + along * st / ct, rate_rad_s.y * cf - rate_rad_s.z * sf, along / ct)
}

/// Body rates from Euler rates, the inverse of (2.3): p, q, r in rad/s.
pub fn body_rates_from_euler(euler_rad: Vector3<f64>, euler_rate_rad_s: Vector3<f64>) -> Vector3<f64> {
    let (sf, cf) = euler_rad.x.sin_cos();
    let (st, ct) = euler_rad.y.sin_cos();
    Vector3::new(
        euler_rate_rad_s.x - euler_rate_rad_s.z * st,
        euler_rate_rad_s.y * cf + euler_rate_rad_s.z * ct * sf,
        -euler_rate_rad_s.y * sf + euler_rate_rad_s.z * ct * cf,
    )
}

/// Angle between two attitudes in rad (geodesic distance on SO(3)).
pub fn geodesic_angle_rad(a: &Vector4<f64>, b: &Vector4<f64>) -> f64 {
    2.0 * a.dot(b).abs().min(1.0).acos()
}

/// The same angle from -pi to pi, rad.
pub fn within_half_turn(angle_rad: f64) -> f64 {
    (angle_rad + PI).rem_euclid(TAU) - PI
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_angle_within_half_a_turn_is_the_same_angle() {
        for (angle_rad, want_rad) in
            [(0.3, 0.3), (-0.3, -0.3), (4.0, 4.0 - TAU), (-7.0, TAU - 7.0), (20.0, 20.0 - 3.0 * TAU)]
        {
            assert!((within_half_turn(angle_rad) - want_rad).abs() < 1e-12, "{angle_rad}");
        }
    }

    const ATTITUDES: [[f64; 3]; 4] = [[0.1, -0.2, 0.3], [-1.2, 0.9, 2.8], [0.0, 0.0, 1.6], [2.9, -1.4, -3.0]];

    #[test]
    fn euler_quaternion_and_matrix_agree() {
        for e in ATTITUDES.map(Vector3::from) {
            let q = quaternion_from_euler(e);
            assert!((dcm_from_quaternion(&q) - dcm_from_euler(e)).norm() < 1e-14);
            assert!((euler_from_quaternion(&q) - e).norm() < 1e-12, "{e}");
            assert!((euler_from_dcm(&dcm_from_euler(e)) - e).norm() < 1e-12, "{e}");
        }
    }

    #[test]
    fn forward_flight_at_90_degrees_yaw_goes_east() {
        // The resolution of (2.1)/(2.2): only the transpose of (2.2) turns body into inertial right-handedly.
        let dcm = dcm_from_euler(Vector3::new(0.0, 0.0, std::f64::consts::FRAC_PI_2));
        let velocity_ned = dcm.transpose() * Vector3::new(1.0, 0.0, 0.0);
        assert!((velocity_ned - Vector3::new(0.0, 1.0, 0.0)).norm() < 1e-15);
    }

    #[test]
    fn quaternion_rate_matches_the_euler_rates_of_2_3() {
        let rate = Vector3::new(0.3, -0.7, 1.1);
        for e in ATTITUDES.map(Vector3::from) {
            let h = 1e-6;
            let q = quaternion_from_euler(e);
            let ahead = (q + h * quaternion_derivative(&q, &rate)).normalize();
            let behind = (q - h * quaternion_derivative(&q, &rate)).normalize();
            let numeric = (euler_from_quaternion(&ahead) - euler_from_quaternion(&behind)) / (2.0 * h);
            let analytic = euler_rates_from_body(e, rate);
            assert!((numeric - analytic).norm() < 1e-7, "{numeric} {analytic}");
            assert!((body_rates_from_euler(e, analytic) - rate).norm() < 1e-12);
        }
    }

    #[test]
    fn small_rotation_matches_the_euler_matrix() {
        let tilt = Vector3::new(0.02, 0.0, 0.0);
        assert!((dcm_from_rotation_vector(tilt) - dcm_from_euler(tilt)).norm() < 1e-15);
        let tilt = Vector3::new(0.0, -0.03, 0.0);
        assert!((dcm_from_rotation_vector(tilt) - dcm_from_euler(tilt)).norm() < 1e-15);
    }

    #[test]
    fn geodesic_angle_of_a_single_axis_turn_is_the_turn() {
        let a = quaternion_from_euler(Vector3::zeros());
        let b = quaternion_from_euler(Vector3::new(0.0, 0.4, 0.0));
        assert!((geodesic_angle_rad(&a, &b) - 0.4).abs() < 1e-12);
        assert!((geodesic_angle_rad(&a, &-b) - 0.4).abs() < 1e-12);
    }
}
