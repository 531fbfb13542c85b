//! The linear model about an equilibrium for python-control, MATLAB and GNU Octave: states, inputs and matrices as `quadlab linearize`
//! shows them, the rotors' lag and dead time by themselves, and the transfer function of each channel.

use std::fmt::Write as _;

use design::plant::{
    CANCEL_TOLERANCE, Channel, INPUT_UNITS, INPUTS, Linear, STATE_UNITS, STATES, TrimTarget,
};
use model::Model;
use nalgebra::SMatrix;

use crate::error::ExportError;
use crate::left_out::{Export, LeftOut, comments};

pub(crate) fn python(model: &Model, target: &TrimTarget) -> Result<Export, ExportError> {
    let (linear, channels) = linearised(model, target)?;
    let left_out = what_is_left_out(&linear);
    let mut text = header(model, &linear, &left_out, "# ");
    let matrix = |name: &str, rows: Vec<String>| {
        let rows: Vec<String> = rows.iter().map(|row| format!("    [{row}],")).collect();
        format!("{name} = np.array([\n{}\n])\n", rows.join("\n"))
    };
    text.push_str("import control\nimport numpy as np\n\n");
    let _ = writeln!(text, "states = {STATES:?}\nstate_units = {STATE_UNITS:?}");
    let _ = writeln!(text, "inputs = {INPUTS:?}\ninput_units = {INPUT_UNITS:?}");
    let _ = writeln!(text, "equilibrium_state = np.array({:?})", linear.equilibrium.state);
    let _ = writeln!(text, "equilibrium_input = np.array({:?})", linear.equilibrium.inputs);
    text += &matrix("A", rows(&linear.a, ", "));
    text += &matrix("B", rows(&linear.b, ", "));
    text.push_str("plant = control.ss(A, B, np.eye(12), np.zeros((12, 4)), states=states, inputs=inputs, outputs=states)\n");
    match linear.motor_lag_rad_s {
        Some(lag) => {
            let _ = writeln!(text, "rotor = control.tf([{lag}], [1, {lag}])  # the lag of a rotor, in series before each input");
            let _ = writeln!(
                text,
                "plant_with_rotors = control.series(control.ss(-{lag} * np.eye(4), {lag} * np.eye(4), np.eye(4), 0), plant)"
            );
        }
        None => text.push_str(
            "rotor = control.tf([1], [1])  # the rotors follow at once, or their lag is not known\nplant_with_rotors = plant\n",
        ),
    }
    let _ = writeln!(text, "dead_time_s = {}  # of each input, not in the plant", linear.input_delay_s);
    text.push_str("channels = {\n");
    for channel in &channels {
        let _ = writeln!(
            text,
            "    '{}': control.tf({:?}, {:?}),  # from {} to {}",
            channel.id.name,
            channel.numerator(),
            channel.denominator(),
            INPUTS[channel.id.input],
            STATES[channel.id.output]
        );
    }
    text.push_str("}\n");
    Ok(Export { text, left_out })
}

pub(crate) fn octave(model: &Model, target: &TrimTarget) -> Result<Export, ExportError> {
    let (linear, channels) = linearised(model, target)?;
    let left_out = what_is_left_out(&linear);
    let mut text = header(model, &linear, &left_out, "% ");
    text.push_str("% Octave: pkg load control. MATLAB: Control System Toolbox.\n");
    let named = |names: &[&str]| names.iter().map(|name| format!("'{name}'")).collect::<Vec<_>>().join(", ");
    let numbers = |values: &[f64]| joined(values, " ");
    let matrix = |name: &str, rows: Vec<String>| format!("{name} = [\n{}\n];\n", rows.join("\n"));
    let _ = writeln!(text, "states = {{{}}};\ninputs = {{{}}};", named(&STATES), named(&INPUTS));
    let _ = writeln!(text, "equilibrium_state = [{}]';", numbers(&linear.equilibrium.state));
    let _ = writeln!(text, "equilibrium_input = [{}]';", numbers(&linear.equilibrium.inputs));
    text += &matrix("A", rows(&linear.a, " "));
    text += &matrix("B", rows(&linear.b, " "));
    text.push_str("C = eye(12);\nD = zeros(12, 4);\n");
    text.push_str("plant = ss(A, B, C, D);\n");
    match linear.motor_lag_rad_s {
        Some(lag) => {
            let _ = writeln!(text, "rotor = tf({lag}, [1 {lag}]); % the lag of a rotor, in series before each input");
            let _ = writeln!(
                text,
                "plant_with_rotors = plant * ss(-{lag} * eye(4), {lag} * eye(4), eye(4), zeros(4));"
            );
        }
        None => text.push_str(
            "rotor = tf(1, 1); % the rotors follow at once, or their lag is not known\nplant_with_rotors = plant;\n",
        ),
    }
    let _ = writeln!(text, "dead_time_s = {}; % of each input, not in the plant", linear.input_delay_s);
    for channel in &channels {
        let _ = writeln!(
            text,
            "channels.{} = tf([{}], [{}]); % from {} to {}",
            channel.id.name.replace(['-', ' ', '/'], "_"),
            numbers(&channel.numerator()),
            numbers(&channel.denominator()),
            INPUTS[channel.id.input],
            STATES[channel.id.output]
        );
    }
    Ok(Export { text, left_out })
}

/// Numbers with all their digits.
fn joined<'a>(values: impl IntoIterator<Item = &'a f64>, separator: &str) -> String {
    values.into_iter().map(f64::to_string).collect::<Vec<_>>().join(separator)
}

/// The rows of a matrix.
fn rows<const R: usize, const C: usize>(matrix: &SMatrix<f64, R, C>, separator: &str) -> Vec<String> {
    matrix.row_iter().map(|row| joined(row.iter(), separator)).collect()
}

fn linearised(model: &Model, target: &TrimTarget) -> Result<(Linear, Vec<Channel>), ExportError> {
    let linear = Linear::new(model, target)?;
    let channels = linear.channels(CANCEL_TOLERANCE)?;
    Ok((linear, channels))
}

fn header(model: &Model, linear: &Linear, left_out: &[LeftOut], mark: &str) -> String {
    let mut text =
        format!("{mark}{}, linear about an equilibrium.\n", report::plain_line(&model.vehicle.name));
    let units = |names: &[&str], units: &[&str]| {
        names.iter().zip(units).map(|(name, unit)| format!("{name} ({unit})")).collect::<Vec<_>>().join(", ")
    };
    let _ = writeln!(
        text,
        "{mark}States, north-east-down and forward-right-down: {}.",
        units(&STATES, &STATE_UNITS)
    );
    let _ = writeln!(text, "{mark}Inputs: {}.", units(&INPUTS, &INPUT_UNITS));
    let speeds = linear.equilibrium.rotor_rad_s.map(|speed| report::significant(speed, 6)).join(", ");
    let _ = writeln!(text, "{mark}Rotors at the equilibrium: {speeds} {}.", model.rotor_quantity().unit());
    let _ = writeln!(
        text,
        "{mark}`plant` is without the rotors' lag and the dead time, `plant_with_rotors` without the dead time only."
    );
    if !left_out.is_empty() {
        text.push_str(&comments(left_out, mark));
    }
    text
}

fn what_is_left_out(linear: &Linear) -> Vec<LeftOut> {
    let mut all = Vec::new();
    if linear.b_derivative.iter().any(|entry| *entry != 0.0) {
        all.push(LeftOut {
            effect: "rotor-inertia".into(),
            why: "what the derivative of the inputs adds is not in the state space".into(),
        });
    }
    all
}
