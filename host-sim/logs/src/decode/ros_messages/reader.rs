//! A definition as a tree that knows which column each number goes to, and messages through it.

use super::super::common::budget::Budget;
use super::definition::{Count, Definitions, Field, Kind, Primitive};
use super::serialised::Serialised;
use crate::log::{Column, Values};

/// The same for every width.
macro_rules! each_vector {
    ($values:expr, $inner:ident => $what:expr) => {
        match $values {
            Values::I8($inner) => $what,
            Values::U8($inner) => $what,
            Values::I16($inner) => $what,
            Values::U16($inner) => $what,
            Values::I32($inner) => $what,
            Values::U32($inner) => $what,
            Values::I64($inner) => $what,
            Values::U64($inner) => $what,
            Values::F32($inner) => $what,
            Values::F64($inner) => $what,
        }
    };
}

/// Elements of an array that become columns.
const MOST_ELEMENTS: usize = 64;
/// Columns of a table.
const MOST_COLUMNS: usize = 1024;
/// Parts of a message with all that is in it.
const MOST_NODES: usize = 16_384;
/// Messages in messages.
const DEEPEST: usize = 16;

/// Reads messages of one type into columns.
#[derive(Debug)]
pub(super) struct Reader {
    definitions: Definitions,
    root: Vec<Node>,
    columns: Columns,
}

/// A part of a message. Columns are none where too many were asked for, or in what is only left out.
#[derive(Debug)]
enum Node {
    Number {
        primitive: Primitive,
        column: Option<usize>,
    },
    Time {
        signed: bool,
        column: Option<usize>,
    },
    Text,
    /// An empty message, which CDR gives a byte.
    Empty,
    Group(Vec<Node>),
    Fixed {
        first: Vec<Node>,
        more: usize,
        left_out: Box<Node>,
    },
    Any {
        name: String,
        kind: Kind,
        first: Vec<Node>,
        left_out: Box<Node>,
    },
}

#[derive(Debug, Default)]
struct Columns {
    all: Vec<Column>,
    rows: usize,
    /// Bytes that a row takes.
    row_bytes: usize,
    nodes: usize,
    /// Bytes that new columns may take for the rows so far.
    allowance: usize,
}

impl Reader {
    /// For a message `package/Type`.
    pub(super) fn new(root: &str, definitions: Definitions) -> Result<Self, String> {
        let mut columns = Columns::default();
        let builder = Builder { definitions: &definitions, in_columns: true, may_be_missing: false };
        let fields = definitions.fields(root).ok_or_else(|| format!("{root} is not defined"))?;
        let root = builder.group(fields, "", 0, &mut columns)?;
        Ok(Self { definitions, root, columns })
    }

    /// Reads a message as one row; whether it was whole, and in the budget. Nothing is kept of one that
    /// is not.
    pub(super) fn read(&mut self, mut message: Serialised<'_>, budget: &mut Budget) -> bool {
        let (columns, definitions) = (&mut self.columns, &self.definitions);
        if !budget.take(columns.row_bytes) {
            return false;
        }
        columns.allowance = budget.next();
        let whole = self.root.iter_mut().try_for_each(|node| node.read(&mut message, definitions, columns));
        budget.take(budget.next() - columns.allowance);
        if whole.is_some() {
            columns.rows += 1;
        } else {
            columns.all.iter_mut().for_each(|column| truncate(&mut column.values, columns.rows));
        }
        whole.is_some()
    }

    pub(super) fn into_columns(mut self) -> Vec<Column> {
        for column in &mut self.columns.all {
            each_vector!(&mut column.values, values => values.shrink_to_fit());
        }
        self.columns.all
    }
}

/// Makes the tree of a definition.
struct Builder<'a> {
    definitions: &'a Definitions,
    in_columns: bool,
    /// Whether a message may come without this part.
    may_be_missing: bool,
}

impl Builder<'_> {
    fn group(
        &self,
        fields: &[Field],
        prefix: &str,
        depth: usize,
        columns: &mut Columns,
    ) -> Result<Vec<Node>, String> {
        let node = |field: &Field| {
            let dot = if prefix.is_empty() { "" } else { "." };
            self.field(field, format!("{prefix}{dot}{}", field.name), depth, columns)
        };
        fields.iter().map(node).collect()
    }

    fn field(
        &self,
        field: &Field,
        name: String,
        depth: usize,
        columns: &mut Columns,
    ) -> Result<Node, String> {
        let left_out = || Self { in_columns: false, ..*self };
        match field.count {
            Count::One => self.element(&field.kind, &name, depth, columns),
            Count::Fixed(length) => {
                let known = if self.in_columns { length.min(MOST_ELEMENTS) } else { 0 };
                let element = |k: usize| self.element(&field.kind, &format!("{name}[{k}]"), depth, columns);
                let first = (0..known).map(element).collect::<Result<_, _>>()?;
                let left_out = Box::new(left_out().element(&field.kind, "", depth, columns)?);
                Ok(Node::Fixed { first, more: length - known, left_out })
            }
            Count::Any => {
                let left_out = Box::new(left_out().element(&field.kind, "", depth, columns)?);
                let name = if self.in_columns { name } else { String::new() };
                Ok(Node::Any { name, kind: field.kind.clone(), first: Vec::new(), left_out })
            }
        }
    }

    fn element(&self, kind: &Kind, name: &str, depth: usize, columns: &mut Columns) -> Result<Node, String> {
        columns.nodes += 1;
        if columns.nodes > MOST_NODES || depth > DEEPEST {
            return Err("its definition has too many parts, or parts within parts".into());
        }
        Ok(match kind {
            Kind::Text => Node::Text,
            Kind::Primitive(primitive) => {
                let column = self.column(name, empty_values(*primitive, self.may_be_missing), columns);
                Node::Number { primitive: *primitive, column }
            }
            Kind::Time { signed } => {
                let values =
                    if self.may_be_missing { Values::F64(Vec::new()) } else { Values::I64(Vec::new()) };
                Node::Time { signed: *signed, column: self.column(name, values, columns) }
            }
            Kind::Message(message) => {
                let fields =
                    self.definitions.fields(message).ok_or_else(|| format!("{message} is not defined"))?;
                let nodes = self.group(fields, name, depth + 1, columns)?;
                if nodes.is_empty() { Node::Empty } else { Node::Group(nodes) }
            }
        })
    }

    /// A new column, NaN in the rows so far.
    fn column(&self, name: &str, mut values: Values, columns: &mut Columns) -> Option<usize> {
        if !self.in_columns || columns.all.len() >= MOST_COLUMNS {
            return None;
        }
        columns.allowance = columns.allowance.checked_sub(columns.rows * width(&values))?;
        (0..columns.rows).for_each(|_| push_missing(&mut values));
        columns.row_bytes += width(&values);
        columns.all.push(Column { name: name.into(), values });
        Some(columns.all.len() - 1)
    }
}

impl Node {
    fn read(
        &mut self,
        message: &mut Serialised<'_>,
        definitions: &Definitions,
        columns: &mut Columns,
    ) -> Option<()> {
        match self {
            Self::Number { primitive, column: Some(column) } => {
                read_number(message, *primitive, &mut columns.all[*column].values)
            }
            Self::Number { primitive, column: None } => message.skip(primitive.bytes(), 1),
            Self::Time { signed, column } => {
                let seconds = if *signed { i64::from(message.i32()?) } else { i64::from(message.u32()?) };
                let ns = seconds * 1_000_000_000 + i64::from(message.u32()?);
                match column.map(|column| &mut columns.all[column].values) {
                    Some(Values::I64(values)) => values.push(ns),
                    Some(Values::F64(values)) => values.push(ns as f64),
                    _ => {}
                }
                Some(())
            }
            Self::Text => message.skip_text(),
            Self::Empty => message.skip(1, usize::from(message.is_cdr())),
            Self::Group(nodes) => {
                nodes.iter_mut().try_for_each(|node| node.read(message, definitions, columns))
            }
            Self::Fixed { first, more, left_out } => {
                first.iter_mut().try_for_each(|node| node.read(message, definitions, columns))?;
                left_out.skip(message, *more, definitions, columns)
            }
            Self::Any { name, kind, first, left_out } => {
                let count = message.length()?;
                if !name.is_empty() {
                    grow(first, count.min(MOST_ELEMENTS), name, kind, definitions, columns);
                }
                let known = first.len().min(count);
                first[..known].iter_mut().try_for_each(|node| node.read(message, definitions, columns))?;
                first[known..].iter().for_each(|node| node.push_missing(columns));
                left_out.skip(message, count - known, definitions, columns)
            }
        }
    }

    /// Leaves out so many elements of this kind.
    fn skip(
        &mut self,
        message: &mut Serialised<'_>,
        count: usize,
        definitions: &Definitions,
        columns: &mut Columns,
    ) -> Option<()> {
        match self {
            Self::Number { primitive, .. } => message.skip(primitive.bytes(), count),
            // Nothing is there to be read, however many there are said to be.
            Self::Empty if !message.is_cdr() => Some(()),
            _ if !message.is_cdr() && self.is_nothing() => Some(()),
            _ => (0..count).try_for_each(|_| self.read(message, definitions, columns)),
        }
    }

    /// Whether it takes no bytes without CDR.
    fn is_nothing(&self) -> bool {
        match self {
            Self::Empty => true,
            Self::Group(nodes) => nodes.iter().all(Self::is_nothing),
            Self::Fixed { first, more, left_out } => {
                first.iter().all(Self::is_nothing) && (*more == 0 || left_out.is_nothing())
            }
            Self::Number { .. } | Self::Time { .. } | Self::Text | Self::Any { .. } => false,
        }
    }

    /// NaN in all columns of an element that a message does not have.
    fn push_missing(&self, columns: &mut Columns) {
        match self {
            Self::Number { column: Some(column), .. } | Self::Time { column: Some(column), .. } => {
                push_missing(&mut columns.all[*column].values);
            }
            Self::Group(nodes) | Self::Fixed { first: nodes, .. } | Self::Any { first: nodes, .. } => {
                nodes.iter().for_each(|node| node.push_missing(columns));
            }
            _ => {}
        }
    }
}

/// Makes columns for elements that no message had so far.
fn grow(
    first: &mut Vec<Node>,
    count: usize,
    name: &str,
    kind: &Kind,
    definitions: &Definitions,
    columns: &mut Columns,
) {
    while first.len() < count && columns.all.len() < MOST_COLUMNS {
        let builder = Builder { definitions, in_columns: true, may_be_missing: true };
        match builder.element(kind, &format!("{name}[{}]", first.len()), 0, columns) {
            Ok(node) => first.push(node),
            Err(_) => break,
        }
    }
}

impl Primitive {
    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

/// Values of a type; if some may be missing, of the narrowest type with NaN that holds it.
fn empty_values(primitive: Primitive, may_be_missing: bool) -> Values {
    use Primitive::{F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
    match (primitive, may_be_missing) {
        (F32, _) | (I8 | U8 | I16 | U16, true) => Values::F32(Vec::new()),
        (F64, _) | (I32 | U32 | I64 | U64, true) => Values::F64(Vec::new()),
        (I8, false) => Values::I8(Vec::new()),
        (U8, false) => Values::U8(Vec::new()),
        (I16, false) => Values::I16(Vec::new()),
        (U16, false) => Values::U16(Vec::new()),
        (I32, false) => Values::I32(Vec::new()),
        (U32, false) => Values::U32(Vec::new()),
        (I64, false) => Values::I64(Vec::new()),
        (U64, false) => Values::U64(Vec::new()),
    }
}

fn read_number(message: &mut Serialised<'_>, primitive: Primitive, values: &mut Values) -> Option<()> {
    match (values, primitive) {
        (Values::F64(values), Primitive::F64) => values.push(message.f64()?),
        (Values::F32(values), Primitive::F32) => values.push(message.f32()?),
        (Values::I8(values), Primitive::I8) => values.push(message.i8()?),
        (Values::U8(values), Primitive::U8) => values.push(message.u8()?),
        (Values::I16(values), Primitive::I16) => values.push(message.i16()?),
        (Values::U16(values), Primitive::U16) => values.push(message.u16()?),
        (Values::I32(values), Primitive::I32) => values.push(message.i32()?),
        (Values::U32(values), Primitive::U32) => values.push(message.u32()?),
        (Values::I64(values), Primitive::I64) => values.push(message.i64()?),
        (Values::U64(values), Primitive::U64) => values.push(message.u64()?),
        (Values::F32(values), Primitive::I8) => values.push(message.i8()?.into()),
        (Values::F32(values), Primitive::U8) => values.push(message.u8()?.into()),
        (Values::F32(values), Primitive::I16) => values.push(message.i16()?.into()),
        (Values::F32(values), Primitive::U16) => values.push(message.u16()?.into()),
        (Values::F64(values), Primitive::I32) => values.push(message.i32()?.into()),
        (Values::F64(values), Primitive::U32) => values.push(message.u32()?.into()),
        (Values::F64(values), Primitive::I64) => values.push(message.i64()? as f64),
        (Values::F64(values), Primitive::U64) => values.push(message.u64()? as f64),
        // A column has one of the types above.
        _ => return None,
    }
    Some(())
}

fn truncate(values: &mut Values, rows: usize) {
    each_vector!(values, values => values.truncate(rows));
}

fn width(values: &Values) -> usize {
    fn of<T>(_: &[T]) -> usize {
        size_of::<T>()
    }
    each_vector!(values, values => of(values))
}

/// NaN, or zero where there is none.
fn push_missing(values: &mut Values) {
    match values {
        Values::F32(values) => values.push(f32::NAN),
        Values::F64(values) => values.push(f64::NAN),
        other => each_vector!(other, values => values.push(Default::default())),
    }
}
