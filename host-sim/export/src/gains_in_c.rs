//! Gains as a header in C, for the flight law as a library (`firmware/law-c`).

use std::fmt::Write as _;

use craft::image::{MAX_IMAGE_LEN, encode};
use gains_file::Gains;
use model::Model;

use crate::error::ExportError;

/// Bytes in a line.
const IN_A_LINE: usize = 16;

/// A header with `gains` as the bytes that the law in C starts with, and their control period.
///
/// # Errors
/// Gains that do not fit into an image.
pub fn gains_header(gains: &Gains, model: &Model) -> Result<String, ExportError> {
    let mut buffer = [0; MAX_IMAGE_LEN];
    // A law in C is not asked for the files that its gains come from.
    let image = encode(&gains.config, &[0; 32], &mut buffer).ok_or(ExportError::LargeGains)?;
    let name = report::plain_line(&model.vehicle.name).replace("*/", "* /");
    let mut text = format!(
        "/* Gains of {name} for quadlab_law.h, by quadlab {}. */\n#ifndef QUADLAB_GAINS_H\n#define QUADLAB_GAINS_H\n\n\
         #include <stdint.h>\n\n/* Control period, s. */\n#define QUADLAB_SAMPLE_TIME_S {:?}\n\n\
         static const uint8_t quadlab_gains[{}] = {{\n",
        env!("CARGO_PKG_VERSION"),
        gains.config.sample_time_s,
        image.len()
    );
    for line in image.chunks(IN_A_LINE) {
        let bytes: Vec<String> = line.iter().map(|byte| format!("0x{byte:02x}")).collect();
        let _ = writeln!(text, "    {},", bytes.join(", "));
    }
    text += "};\n\n#endif\n";
    Ok(text)
}
