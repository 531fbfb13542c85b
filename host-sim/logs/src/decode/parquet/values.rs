//! Numbers of a batch into the values of a column.

use crate::log::Values;

/// Numbers in the widths that Parquet stores.
#[derive(Debug)]
pub(super) enum Numbers {
    Bool(Vec<bool>),
    I32(Vec<i32>),
    I64(Vec<i64>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

/// Adds numbers; `present` says of each row whether it has one.
#[expect(clippy::cast_possible_truncation, reason = "the schema says that they are of that width")]
#[expect(clippy::cast_sign_loss, reason = "unsigned numbers are stored as signed ones")]
pub(super) fn append(values: &mut Values, numbers: &Numbers, present: Option<&[bool]>) -> Option<()> {
    if let (Values::F32(narrow), Numbers::F64(numbers)) = (&*values, numbers)
        && !numbers.iter().all(is_single)
    {
        *values = Values::F64(narrow.iter().copied().map(f64::from).collect());
    }
    if let Some(present) = present {
        make_nullable(values);
        let mut next = as_f64(numbers).into_iter();
        for &is_present in present {
            push_f64(values, if is_present { next.next()? } else { f64::NAN });
        }
        return Some(());
    }
    match (values, numbers) {
        (Values::U8(to), Numbers::Bool(from)) => to.extend(from.iter().map(|&x| u8::from(x))),
        (Values::I8(to), Numbers::I32(from)) => to.extend(from.iter().map(|&x| x as i8)),
        (Values::U8(to), Numbers::I32(from)) => to.extend(from.iter().map(|&x| x as u8)),
        (Values::I16(to), Numbers::I32(from)) => to.extend(from.iter().map(|&x| x as i16)),
        (Values::U16(to), Numbers::I32(from)) => to.extend(from.iter().map(|&x| x as u16)),
        (Values::I32(to), Numbers::I32(from)) => to.extend(from),
        (Values::U32(to), Numbers::I64(from)) => to.extend(from.iter().map(|&x| x as u32)),
        (Values::I64(to), Numbers::I64(from)) => to.extend(from),
        (Values::U64(to), Numbers::I64(from)) => to.extend(from.iter().map(|&x| x as u64)),
        (Values::F32(to), Numbers::F32(from)) => to.extend(from),
        (Values::F64(to), Numbers::F64(from)) => to.extend(from),
        // The column became wider, for numbers were missing before.
        (values, numbers) => as_f64(numbers).into_iter().for_each(|number| push_f64(values, number)),
    }
    Some(())
}

/// Halves a column of doubles that are single-precision numbers, as tables of most programs are that know one width: no number changes.
#[expect(clippy::cast_possible_truncation, reason = "each of them is such a number")]
pub(super) fn narrow(values: &mut Values) {
    if let Values::F64(wide) = values
        && wide.iter().all(is_single)
    {
        *values = Values::F32(wide.iter().map(|&number| number as f32).collect());
    }
}

/// Whether a number is one of single precision, or missing.
#[expect(clippy::cast_possible_truncation, reason = "that is what is asked")]
fn is_single(number: &f64) -> bool {
    number.is_nan() || f64::from(*number as f32) == *number
}

/// Makes room for the first batch, mostly the only one, and no more.
pub(super) fn reserve(values: &mut Values, count: usize) {
    match values {
        _ if !values.is_empty() => {}
        Values::I8(to) => to.reserve_exact(count),
        Values::U8(to) => to.reserve_exact(count),
        Values::I16(to) => to.reserve_exact(count),
        Values::U16(to) => to.reserve_exact(count),
        Values::I32(to) => to.reserve_exact(count),
        Values::U32(to) => to.reserve_exact(count),
        Values::I64(to) => to.reserve_exact(count),
        Values::U64(to) => to.reserve_exact(count),
        Values::F32(to) => to.reserve_exact(count),
        Values::F64(to) => to.reserve_exact(count),
    }
}

/// Adds so many missing numbers.
pub(super) fn pad(values: &mut Values, count: usize) {
    make_nullable(values);
    (0..count).for_each(|_| push_f64(values, f64::NAN));
}

fn as_f64(numbers: &Numbers) -> Vec<f64> {
    match numbers {
        Numbers::Bool(numbers) => numbers.iter().map(|&x| f64::from(u8::from(x))).collect(),
        Numbers::I32(numbers) => numbers.iter().map(|&x| f64::from(x)).collect(),
        Numbers::I64(numbers) => numbers.iter().map(|&x| x as f64).collect(),
        Numbers::F32(numbers) => numbers.iter().map(|&x| f64::from(x)).collect(),
        Numbers::F64(numbers) => numbers.clone(),
    }
}

/// Into the narrowest type with NaN that holds the numbers.
fn make_nullable(values: &mut Values) {
    *values = match std::mem::replace(values, Values::F64(Vec::new())) {
        Values::I8(from) => Values::F32(from.into_iter().map(f32::from).collect()),
        Values::U8(from) => Values::F32(from.into_iter().map(f32::from).collect()),
        Values::I16(from) => Values::F32(from.into_iter().map(f32::from).collect()),
        Values::U16(from) => Values::F32(from.into_iter().map(f32::from).collect()),
        same @ (Values::F32(_) | Values::F64(_)) => same,
        wide => Values::F64(wide.to_f64()),
    };
}

#[expect(clippy::cast_possible_truncation, reason = "the numbers were that narrow before")]
fn push_f64(values: &mut Values, number: f64) {
    match values {
        Values::F32(to) => to.push(number as f32),
        Values::F64(to) => to.push(number),
        // Only columns with NaN come here.
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn doubles_take_half_the_room_where_that_changes_none_of_them() {
        let mut values = Values::F64(Vec::new());
        append(&mut values, &Numbers::F64(vec![0.5, f64::from(-1e30_f32), f64::INFINITY]), None).unwrap();
        append(&mut values, &Numbers::F64(vec![2.0]), Some(&[false, true])).unwrap();
        narrow(&mut values);
        assert!(matches!(values, Values::F32(_)));
        append(&mut values, &Numbers::F64(vec![0.1]), None).unwrap();
        narrow(&mut values);
        let Values::F64(values) = values else { panic!("{values:?}") };
        assert_eq!(values[..3], [0.5, (-1e30_f32).into(), f64::INFINITY]);
        assert!(values[3].is_nan());
        assert_eq!(values[4..], [2.0, 0.1]);
    }

    #[test]
    fn missing_numbers_are_nan() {
        let mut values = Values::U16(Vec::new());
        append(&mut values, &Numbers::I32(vec![65_535, 1]), None).unwrap();
        append(&mut values, &Numbers::I32(vec![7]), Some(&[false, true])).unwrap();
        append(&mut values, &Numbers::I32(vec![8]), None).unwrap();
        let Values::F32(values) = values else { panic!("{values:?}") };
        assert_eq!(values[..2], [65_535.0, 1.0]);
        assert!(values[2].is_nan());
        assert_eq!(values[3..], [7.0, 8.0]);
    }
}
