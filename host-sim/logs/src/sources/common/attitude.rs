//! Angles into quaternions.

use nalgebra::Vector3;

/// Quaternions w, x, y, z of roll, pitch and yaw, rad (front-right-down to north-east-down), with continuous
/// signs.
pub(in crate::sources) fn quaternions([roll, pitch, yaw]: [&[f64]; 3]) -> [Vec<f64>; 4] {
    let mut all = [const { Vec::new() }; 4];
    let mut last = [1.0, 0.0, 0.0, 0.0];
    for ((&roll, &pitch), &yaw) in roll.iter().zip(pitch).zip(yaw) {
        let mut now: [f64; 4] = model::frames::quaternion_from_euler(Vector3::new(roll, pitch, yaw)).into();
        if now.iter().zip(last).map(|(a, b)| a * b).sum::<f64>() < 0.0 {
            now = now.map(|component| -component);
        }
        if now.iter().all(|component| component.is_finite()) {
            last = now;
        }
        all.iter_mut().zip(now).for_each(|(all, component)| all.push(component));
    }
    all
}
