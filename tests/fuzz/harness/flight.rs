//! Flight files and maps of their columns: a flight whose times rise and that can be written and read again, or why not.

use std::path::Path;

use flights::{Column, ColumnMap, Flight};

/// A flight file.
pub(crate) fn flight(bytes: &[u8]) -> Result<(), String> {
    with_map(bytes, &ColumnMap::default())
}

/// A map of columns, applied to a file that has what the corpus' map names.
pub(crate) fn columns(bytes: &[u8]) -> Result<(), String> {
    const FLIGHT: &[u8] = b"stamp,n,e,d,w,i,j,k,gx,q,r,m1,cmd2,cmd3,cmd4\n\
        1000000,1,2,3,0.9,0.1,0,0.1,1,2,3,11,12,13,14\n1010000,1,2,3,0.9,0.1,0,0,1,2,3,11,12,13,14\n";
    let text = std::str::from_utf8(bytes).map_err(|error| error.to_string())?;
    let map = ColumnMap::parse(text, Path::new("columns.toml")).map_err(|error| error.to_string())?;
    with_map(FLIGHT, &map)
}

fn with_map(bytes: &[u8], map: &ColumnMap) -> Result<(), String> {
    let path = Path::new("A.csv");
    let flight = Flight::parse_with(bytes, path, map).map_err(|error| error.to_string())?;
    let t = flight.column(Column::T).expect("a flight has times");
    assert!(t.windows(2).all(|pair| pair[0] < pair[1]), "times rise");
    assert!(Flight::parse(flight.to_csv().as_bytes(), path).is_ok(), "what was read is read again");
    Ok(())
}
