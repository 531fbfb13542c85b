//! The scanner before the parser: it refuses what people read in two ways and the library in one, and bounds length and depth.

use crate::user_effects::arithmetic::FUNCTIONS;

/// Longest formula or unit, bytes.
pub(super) const MAX_LENGTH: usize = 2000;
/// Deepest nesting of brackets.
pub(super) const MAX_DEPTH: usize = 20;

/// Functions of two arguments, and the operators that they become.
const OF_TWO: [(&str, &str); 3] = [("min", "&"), ("max", "|"), ("atan2", "@")];

/// The function that looks back: `lag(quantity, time)`. What it makes has a name of its own, which the parser does not look into.
pub(super) const LAG: &str = "lag";
/// The other one: `integral(quantity)`.
pub(super) const INTEGRAL: &str = "integral";
/// What looks back, and how it is written.
const LOOKS_BACK: [(&str, &str); 2] = [
    (LAG, "lag(...) takes the name of a quantity and that of a constant, such as lag(w, memory)"),
    (INTEGRAL, "integral(...) takes the name of a quantity, such as integral(power)"),
];

/// The functions that formulas can call, those of two arguments last.
pub fn functions() -> impl Iterator<Item = &'static str> {
    FUNCTIONS.into_iter().chain(OF_TWO.map(|(name, _)| name)).chain(LOOKS_BACK.map(|(name, _)| name))
}

/// Bytes of the number that a text begins with; 0 if it does not.
pub(super) fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
    let whole = digits(0);
    if whole == 0 {
        return 0;
    }
    let mut end = whole;
    if bytes.get(end) == Some(&b'.') {
        end += 1 + digits(end + 1);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let exponent = digits((end + 1 + sign).min(bytes.len()));
        if exponent > 0 {
            end += 1 + sign + exponent;
        }
    }
    end
}

/// What two operands side by side mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Juxtaposed {
    Refused,
    Multiplied,
}

/// What an open bracket belongs to.
#[derive(Debug, Clone, Copy)]
struct Level {
    /// The operator of a function of two arguments, until its comma has been seen.
    of_two: Option<&'static str>,
    awaits_comma: bool,
    /// A power has been taken since the last other operator.
    in_power: bool,
    /// A quotient has been taken since the last sum.
    in_quotient: bool,
}

impl Level {
    const PLAIN: Self = Self { of_two: None, awaits_comma: false, in_power: false, in_quotient: false };
}

/// Turns a formula into a text that can be read in one way only: names in braces, functions of two arguments as operators,
/// the sign of a term as a factor.
pub(super) struct Scanner<'a> {
    text: &'a str,
    at: usize,
    clear: String,
    levels: Vec<Level>,
    /// Whether an operand has just ended.
    after_operand: bool,
    /// Whether an operator has just been read.
    after_operator: bool,
    juxtaposed: Juxtaposed,
}

impl<'a> Scanner<'a> {
    pub(super) fn new(text: &'a str, juxtaposed: Juxtaposed) -> Self {
        Self {
            text,
            at: 0,
            clear: String::new(),
            levels: vec![Level::PLAIN],
            after_operand: false,
            after_operator: false,
            juxtaposed,
        }
    }

    pub(super) fn run(mut self) -> Result<String, String> {
        if self.text.len() > MAX_LENGTH {
            return Err(format!("is {} bytes long, at most {MAX_LENGTH} are read", self.text.len()));
        }
        while let Some(next) = self.text[self.at..].chars().next() {
            match next {
                ' ' | '\t' | '\n' | '\r' => self.at += 1,
                '0'..='9' => self.number()?,
                'a'..='z' | 'A'..='Z' | '_' => self.name()?,
                '(' => {
                    self.operand("(")?;
                    self.open(Level::PLAIN)?;
                    self.at += 1;
                }
                ')' => self.close()?,
                ',' => self.comma()?,
                '+' | '-' | '*' | '/' | '^' => self.operator(next)?,
                other => return Err(format!("the character {other:?} is not part of a formula")),
            }
        }
        if self.levels.len() > 1 {
            return Err("a bracket is not closed".into());
        }
        if !self.after_operand {
            return Err(if self.clear.is_empty() { "is empty".into() } else { "ends in an operator".into() });
        }
        Ok(self.clear)
    }

    fn level(&mut self) -> &mut Level {
        if self.levels.is_empty() {
            self.levels.push(Level::PLAIN);
        }
        let last = self.levels.len() - 1;
        &mut self.levels[last]
    }

    /// An operand begins with `what`.
    fn operand(&mut self, what: &str) -> Result<(), String> {
        if self.after_operand {
            if self.juxtaposed == Juxtaposed::Refused {
                return Err(format!("an operator is missing before \"{what}\""));
            }
            if self.level().in_quotient {
                return Err(format!("what follows \"/\" is unclear at \"{what}\"; write 1/(a b) or a*b/c"));
            }
            self.level().in_power = false;
            self.clear.push('*');
        }
        Ok(())
    }

    fn ended(&mut self) {
        (self.after_operand, self.after_operator) = (true, false);
    }

    fn number(&mut self) -> Result<(), String> {
        let rest = &self.text[self.at..];
        let number = &rest[..number_length(rest)];
        self.operand(number)?;
        if !number.parse::<f64>().is_ok_and(f64::is_finite) {
            return Err(format!("the number {number} is too large"));
        }
        self.clear.push_str(number);
        self.at += number.len();
        self.ended();
        Ok(())
    }

    fn name(&mut self) -> Result<(), String> {
        let rest = &self.text[self.at..];
        let length = rest.bytes().take_while(|b| b.is_ascii_alphanumeric() || *b == b'_').count();
        let name = &rest[..length];
        let is_call = rest[length..].trim_start().starts_with('(');
        self.operand(name)?;
        let looks_back = LOOKS_BACK.iter().find(|(known, _)| *known == name);
        if let Some((name, usage)) = looks_back.filter(|_| is_call && self.juxtaposed == Juxtaposed::Refused)
        {
            return self.look_back(name, usage);
        }
        let of_two = OF_TWO.iter().find(|(known, _)| *known == name);
        let of_one = FUNCTIONS.contains(&name) || looks_back.is_some();
        match (of_two, of_one, is_call && self.juxtaposed == Juxtaposed::Refused) {
            (Some((_, operator)), _, true) => {
                self.skip_call(length);
                self.clear.push('(');
                self.open(Level { of_two: Some(*operator), awaits_comma: true, ..Level::PLAIN })
            }
            (None, true, true) => {
                self.skip_call(length);
                self.clear.push_str(name);
                self.open(Level::PLAIN)
            }
            (None, false, true) => {
                let known = functions().collect::<Vec<_>>().join(", ");
                Err(format!("\"{name}\" is not a function; known are {known}"))
            }
            (Some(_), _, false) | (_, true, false) if self.juxtaposed == Juxtaposed::Refused => {
                Err(format!("{name} is a function; write {name}(...)"))
            }
            _ => {
                self.clear.push('{');
                self.clear.push_str(name);
                self.clear.push('}');
                self.at += length;
                self.ended();
                Ok(())
            }
        }
    }

    /// A look back, from its name to its closing bracket.
    fn look_back(&mut self, name: &str, usage: &str) -> Result<(), String> {
        let length = name.len();
        let rest = &self.text[self.at + length..];
        let mut depth = 0_usize;
        let end = rest.char_indices().find_map(|(place, c)| {
            match c {
                '(' => depth += 1,
                ')' => depth = depth.saturating_sub(1),
                _ => return None,
            }
            (depth == 0).then_some(place)
        });
        let Some(end) = end else { return Err("a bracket is not closed".into()) };
        let inside: String = rest[..=end].chars().filter(|c| !c.is_whitespace()).collect();
        let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '(' | ')' | ',' | '.');
        if !inside.chars().all(is_plain) {
            return Err(usage.into());
        }
        self.clear.push_str(&format!("{{{name}{inside}}}"));
        self.at += length + end + 1;
        self.ended();
        Ok(())
    }

    /// Past a function's name and its bracket.
    fn skip_call(&mut self, length: usize) {
        let rest = &self.text[self.at + length..];
        self.at += length + rest.find('(').unwrap_or(0) + 1;
    }

    fn open(&mut self, level: Level) -> Result<(), String> {
        if self.levels.len() > MAX_DEPTH {
            return Err(format!("brackets are nested deeper than {MAX_DEPTH}"));
        }
        self.clear.push('(');
        self.levels.push(level);
        (self.after_operand, self.after_operator) = (false, false);
        Ok(())
    }

    fn close(&mut self) -> Result<(), String> {
        if self.levels.len() == 1 {
            return Err("a bracket is closed that was not opened".into());
        }
        if !self.after_operand {
            return Err("nothing stands before \")\"".into());
        }
        let level = self.levels.pop().unwrap_or(Level::PLAIN);
        if level.awaits_comma {
            return Err("a function of two arguments has only one".into());
        }
        self.clear.push_str(if level.of_two.is_some() { "))" } else { ")" });
        self.at += 1;
        self.ended();
        Ok(())
    }

    fn comma(&mut self) -> Result<(), String> {
        let level = *self.level();
        let Some(operator) = level.of_two.filter(|_| level.awaits_comma) else {
            return Err("a comma stands outside a function of two arguments".into());
        };
        if !self.after_operand {
            return Err("nothing stands before \",\"".into());
        }
        *self.level() = Level { of_two: Some(operator), ..Level::PLAIN };
        self.clear.push_str(&format!("){operator}("));
        self.at += 1;
        (self.after_operand, self.after_operator) = (false, false);
        Ok(())
    }

    fn operator(&mut self, operator: char) -> Result<(), String> {
        if !self.after_operand {
            if self.after_operator {
                return Err(format!(
                    "two operators in a row at \"{operator}\"; put a negative number in brackets"
                ));
            }
            if operator != '-' {
                return Err(format!("nothing stands before \"{operator}\""));
            }
            // The library would bind the sign closer than a power.
            self.clear.push_str("(0-1)*");
            self.at += 1;
            self.after_operator = true;
            return Ok(());
        }
        let level = self.level();
        if operator == '^' && level.in_power {
            return Err("a^b^c is unclear; write (a^b)^c or a^(b^c)".into());
        }
        level.in_power = operator == '^';
        level.in_quotient = match operator {
            '/' => true,
            '^' => level.in_quotient,
            _ => false,
        };
        self.clear.push(operator);
        self.at += 1;
        (self.after_operand, self.after_operator) = (false, true);
        Ok(())
    }
}
