//! Checks of a definition's words, coefficients and constants.

use crate::quantity::QUANTITIES;
use crate::sample::MAX_FURTHER;
use crate::user_effects::columns::{is_function, is_word};
use crate::user_effects::definition::{Definition, MAX_COEFFICIENTS, MAX_CONSTANTS, MAX_NAME, MAX_SENTENCE};
use crate::user_effects::dimension::Dimension;
use crate::user_effects::formula::dimension_of;

/// A field and what is wrong with it.
pub(super) type Problem = (String, String);

/// Identifiers that are taken: of the catalogue, and of the users' effects that have been read.
pub(super) struct Known<'a> {
    pub(super) catalogue: &'a [&'a str],
    pub(super) users: Vec<&'a str>,
}

pub(super) fn check_words(definition: &Definition, known: &Known) -> Result<(), Problem> {
    let id = &definition.id;
    let good = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
    if !(id.starts_with(|c: char| c.is_ascii_lowercase()) && id.chars().all(good) && id.len() <= MAX_NAME) {
        let expected = format!("is a word of a to z, digits and -, at most {MAX_NAME} long");
        return Err(("id".into(), expected));
    }
    if known.catalogue.contains(&id.as_str()) {
        return Err(("id".into(), "is an effect of the catalogue; choose another word".into()));
    }
    let sentences = [("sentence", &definition.sentence), ("excitation", &definition.excitation)];
    let sentences = sentences.into_iter().filter_map(|(field, text)| Some((field, text.as_ref()?)));
    let confused = definition.confused_with.values().map(|how| ("confused_with", how));
    for (field, text) in sentences.chain(confused) {
        let one_line = !text.chars().any(char::is_control);
        if text.trim().is_empty() || text.chars().count() > MAX_SENTENCE || !one_line {
            return Err((field.into(), format!("is one line of at most {MAX_SENTENCE} characters")));
        }
    }
    if definition.confused_with.len() > known.catalogue.len() {
        return Err(("confused_with".into(), "names more effects than there are".into()));
    }
    for other in definition.confused_with.keys() {
        if !known.catalogue.contains(&other.as_str()) && !known.users.contains(&other.as_str()) {
            let problem = format!("unknown effect \"{other}\"; known are {}", known.catalogue.join(", "));
            return Err(("confused_with".into(), problem));
        }
    }
    Ok(())
}

fn check_name(field: &str, name: &str, taken: &[&str]) -> Result<(), Problem> {
    let refuse = |problem: String| Err((field.to_owned(), problem));
    if !is_word(name) {
        return refuse(format!("a name is a word of letters, digits and _, at most {MAX_NAME} long"));
    }
    if is_function(name) {
        return refuse("is a function's name; choose another".into());
    }
    if let Some(quantity) = QUANTITIES.iter().find(|q| q.name == name) {
        return refuse(format!("is the {}; choose another name", quantity.meaning));
    }
    if taken.contains(&name) {
        return refuse("the name is given twice".into());
    }
    Ok(())
}

pub(super) fn check_coefficients(definition: &Definition) -> Result<Vec<Dimension>, Problem> {
    let all = &definition.coefficient;
    if all.is_empty() || all.len() > MAX_COEFFICIENTS {
        return Err((
            "coefficient".into(),
            format!("has {}, 1 to {MAX_COEFFICIENTS} are possible", all.len()),
        ));
    }
    let mut dimensions = Vec::new();
    for (k, c) in all.iter().enumerate() {
        let taken: Vec<&str> = all[..k].iter().map(|c| c.name.as_str()).collect();
        let short: String = c.name.chars().take(MAX_NAME).collect();
        let field = format!("coefficient {short:?}");
        check_name(&field, &c.name, &taken)?;
        let [low, high] = c.possible;
        if !(low.is_finite() && high.is_finite() && low < high) {
            return Err((format!("{field}: possible"), "is [smallest, largest]".into()));
        }
        if !(c.typical > 0.0 && c.typical.is_finite()) {
            return Err((format!("{field}: typical"), "is an ordinary magnitude, above 0".into()));
        }
        dimensions.push(dimension_of(&c.unit).map_err(|problem| (format!("{field}: unit"), problem))?);
    }
    Ok(dimensions)
}

pub(super) fn check_constants(definition: &Definition) -> Result<Vec<Dimension>, Problem> {
    let all = &definition.constant;
    if all.len() > MAX_CONSTANTS {
        return Err(("constant".into(), format!("has {}, at most {MAX_CONSTANTS} are possible", all.len())));
    }
    let mut dimensions = Vec::new();
    for (k, c) in all.iter().enumerate() {
        let before = all[..k].iter().map(|c| c.name.as_str());
        let taken: Vec<&str> = definition.coefficient.iter().map(|c| c.name.as_str()).chain(before).collect();
        let short: String = c.name.chars().take(MAX_NAME).collect();
        let field = format!("constant {short:?}");
        check_name(&field, &c.name, &taken)?;
        if !c.value.is_finite() {
            return Err((format!("{field}: value"), "is not finite".into()));
        }
        dimensions.push(dimension_of(&c.unit).map_err(|problem| (format!("{field}: unit"), problem))?);
    }
    Ok(dimensions)
}

pub(super) fn check_columns(definition: &Definition) -> Result<Vec<Dimension>, Problem> {
    let all = &definition.column;
    if all.len() > MAX_FURTHER {
        return Err(("column".into(), format!("has {}, at most {MAX_FURTHER} are possible", all.len())));
    }
    let coefficients = definition.coefficient.iter().map(|c| c.name.as_str());
    let mut taken: Vec<&str> =
        coefficients.chain(definition.constant.iter().map(|c| c.name.as_str())).collect();
    let mut dimensions = Vec::new();
    for column in all {
        let short: String = column.name.chars().take(MAX_NAME).collect();
        let field = format!("column {short:?}");
        check_name(&field, &column.name, &taken)?;
        taken.push(&column.name);
        dimensions.push(dimension_of(&column.unit).map_err(|problem| (format!("{field}: unit"), problem))?);
    }
    Ok(dimensions)
}
