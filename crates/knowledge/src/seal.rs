//! Sums that tell a changed byte: one with each row, and one over all rows of a table.
//!
//! The pages of the file have no sums of their own: a byte that changed inside a weight would be another weight. So each row carries the
//! CRC-32 of what stands in it, and the table `seal` has for each table how many rows there are and the sum of theirs, modulo 2³². The first
//! tells a row that was changed, the second one that is gone or is back. CRC-32 sees every change of up to 32 bits in a row; it
//! is no guard against people.

use rusqlite::types::{ToSqlOutput, Type, ValueRef};
use rusqlite::{Connection, Row, ToSql, Transaction, params_from_iter};

/// A table whose rows have sums.
struct Sealed {
    name: &'static str,
    /// What the sum is over, in this order.
    columns: &'static str,
    /// By which a row is found again.
    key: &'static [usize],
}

const TABLES: [Sealed; 5] = [
    Sealed { name: "decision_table", columns: "name, version, time, weights", key: &[0, 1] },
    Sealed {
        name: "fact",
        columns: "subject, predicate, object, confidence, time, source",
        key: &[0, 1, 2, 5],
    },
    Sealed { name: "pattern", columns: "name, kind, media_type, parameters, bytes", key: &[0] },
    Sealed { name: "schedule", columns: "name, kind, first, period, cron, words", key: &[0] },
    Sealed { name: "map", columns: "name, time, resolution, x, y, heading, width, height, cells", key: &[0] },
];

/// What is added to the file so that it has sums.
pub(crate) const STEP: &str = "
ALTER TABLE decision_table ADD COLUMN crc INTEGER NOT NULL DEFAULT 0;
ALTER TABLE fact ADD COLUMN crc INTEGER NOT NULL DEFAULT 0;
ALTER TABLE pattern ADD COLUMN crc INTEGER NOT NULL DEFAULT 0;
ALTER TABLE schedule ADD COLUMN crc INTEGER NOT NULL DEFAULT 0;
ALTER TABLE map ADD COLUMN crc INTEGER NOT NULL DEFAULT 0;

CREATE TABLE seal (
    name TEXT NOT NULL PRIMARY KEY,
    rows INTEGER NOT NULL,
    crc INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
INSERT INTO seal VALUES ('decision_table', 0, 0), ('fact', 0, 0), ('pattern', 0, 0), ('schedule', 0, 0), ('map', 0, 0);

CREATE TRIGGER decision_table_put AFTER INSERT ON decision_table BEGIN
    UPDATE seal SET rows = rows + 1, crc = (crc + NEW.crc) % 4294967296 WHERE name = 'decision_table'; END;
CREATE TRIGGER decision_table_gone AFTER DELETE ON decision_table BEGIN
    UPDATE seal SET rows = rows - 1, crc = (crc + 4294967296 - OLD.crc) % 4294967296 WHERE name = 'decision_table'; END;
CREATE TRIGGER fact_put AFTER INSERT ON fact BEGIN
    UPDATE seal SET rows = rows + 1, crc = (crc + NEW.crc) % 4294967296 WHERE name = 'fact'; END;
CREATE TRIGGER fact_gone AFTER DELETE ON fact BEGIN
    UPDATE seal SET rows = rows - 1, crc = (crc + 4294967296 - OLD.crc) % 4294967296 WHERE name = 'fact'; END;
CREATE TRIGGER pattern_put AFTER INSERT ON pattern BEGIN
    UPDATE seal SET rows = rows + 1, crc = (crc + NEW.crc) % 4294967296 WHERE name = 'pattern'; END;
CREATE TRIGGER pattern_gone AFTER DELETE ON pattern BEGIN
    UPDATE seal SET rows = rows - 1, crc = (crc + 4294967296 - OLD.crc) % 4294967296 WHERE name = 'pattern'; END;
CREATE TRIGGER schedule_put AFTER INSERT ON schedule BEGIN
    UPDATE seal SET rows = rows + 1, crc = (crc + NEW.crc) % 4294967296 WHERE name = 'schedule'; END;
CREATE TRIGGER schedule_gone AFTER DELETE ON schedule BEGIN
    UPDATE seal SET rows = rows - 1, crc = (crc + 4294967296 - OLD.crc) % 4294967296 WHERE name = 'schedule'; END;
CREATE TRIGGER map_put AFTER INSERT ON map BEGIN
    UPDATE seal SET rows = rows + 1, crc = (crc + NEW.crc) % 4294967296 WHERE name = 'map'; END;
CREATE TRIGGER map_gone AFTER DELETE ON map BEGIN
    UPDATE seal SET rows = rows - 1, crc = (crc + 4294967296 - OLD.crc) % 4294967296 WHERE name = 'map'; END;
";

/// Puts a row with its sum, in the place of the one of its key. `values` are the columns of the sum, in its order.
pub(crate) fn put(transaction: &Transaction<'_>, table: &str, values: &[&dyn ToSql]) -> rusqlite::Result<()> {
    let columns = TABLES.iter().find(|sealed| sealed.name == table).map_or("", |sealed| sealed.columns);
    let crc = sum_of(values)?;
    let marks = "?, ".repeat(values.len());
    let sql = format!("INSERT OR REPLACE INTO {table} ({columns}, crc) VALUES ({marks}?)");
    let all = values.iter().copied().chain([&crc as &dyn ToSql]);
    transaction.execute(&sql, params_from_iter(all)).map(drop)
}

/// Refuses a row whose first `count` columns do not have the sum that stands in the next.
pub(crate) fn verify(row: &Row<'_>, count: usize) -> rusqlite::Result<()> {
    let refused = |why: &str| rusqlite::Error::FromSqlConversionFailure(count, Type::Integer, why.into());
    let crc: i64 = row.get(count)?;
    if sum_in(row, count)? == crc { Ok(()) } else { Err(refused("a row is not what was written")) }
}

/// Goes through all rows. Says what is not as it was written.
pub(crate) fn check(connection: &Connection) -> rusqlite::Result<Result<(), String>> {
    for Sealed { name, columns, .. } in &TABLES {
        let count = columns.split(',').count();
        let mut statement = connection.prepare(&format!("SELECT {columns}, crc FROM {name}"))?;
        let mut rows = statement.query([])?;
        let (mut found, mut sum) = (0_i64, 0_i64);
        while let Some(row) = rows.next()? {
            let crc = sum_in(row, count)?;
            if row.get::<_, i64>(count)? != crc {
                return Ok(Err(format!("a row of {name} is not what was written")));
            }
            (found, sum) = (found + 1, (sum + crc) % MODULUS);
        }
        let sealed: (i64, i64) =
            connection.query_row("SELECT rows, crc FROM seal WHERE name = ?1", [name], |row| {
                Ok((row.get(0)?, row.get(1)?))
            })?;
        if sealed != (found, sum) {
            return Ok(Err(format!("rows of {name} are missing, or are back")));
        }
    }
    Ok(Ok(()))
}

/// Gives sums to the rows of a file that had none.
pub(crate) fn fill(transaction: &Transaction<'_>) -> rusqlite::Result<()> {
    for Sealed { name, columns, key } in &TABLES {
        let names: Vec<&str> = columns.split(", ").collect();
        let mut sums: Vec<(i64, Vec<rusqlite::types::Value>)> = Vec::new();
        let mut statement = transaction.prepare(&format!("SELECT {columns} FROM {name}"))?;
        let mut rows = statement.query([])?;
        while let Some(row) = rows.next()? {
            let key: rusqlite::Result<Vec<_>> = key.iter().map(|at| row.get(*at)).collect();
            sums.push((sum_in(row, names.len())?, key?));
        }
        let fits: Vec<String> = key.iter().map(|at| format!("{} = ?", names[*at])).collect();
        let sql = format!("UPDATE {name} SET crc = ? WHERE {}", fits.join(" AND "));
        for (crc, key) in sums {
            let all = std::iter::once(rusqlite::types::Value::Integer(crc)).chain(key);
            transaction.execute(&sql, params_from_iter(all))?;
        }
        let total = format!(
            "UPDATE seal SET (rows, crc) = (SELECT count(*), coalesce(sum(crc), 0) % {MODULUS} FROM {name}) WHERE name = ?1"
        );
        transaction.execute(&total, [name])?;
    }
    Ok(())
}

/// Sums are added up modulo this.
const MODULUS: i64 = 1 << 32;

fn sum_in(row: &Row<'_>, count: usize) -> rusqlite::Result<i64> {
    let mut hasher = crc32fast::Hasher::new();
    for at in 0..count {
        add(&mut hasher, row.get_ref(at)?);
    }
    Ok(hasher.finalize().into())
}

fn sum_of(values: &[&dyn ToSql]) -> rusqlite::Result<i64> {
    let mut hasher = crc32fast::Hasher::new();
    for value in values {
        match value.to_sql()? {
            ToSqlOutput::Borrowed(value) => add(&mut hasher, value),
            ToSqlOutput::Owned(value) => add(&mut hasher, ValueRef::from(&value)),
            // No other kind of value is put.
            _ => {}
        }
    }
    Ok(hasher.finalize().into())
}

/// Kind, length and bytes, so that no two rows run together to the same bytes.
fn add(hasher: &mut crc32fast::Hasher, value: ValueRef<'_>) {
    let (kind, bytes): (u8, &[u8]) = match value {
        ValueRef::Null => (0, &[]),
        ValueRef::Integer(n) => (1, &n.to_le_bytes()),
        // The database makes no difference between zero and minus zero.
        ValueRef::Real(x) => (2, &(x + 0.0).to_le_bytes()),
        ValueRef::Text(text) => (3, text),
        ValueRef::Blob(blob) => (4, blob),
    };
    hasher.update(&[kind]);
    hasher.update(&(bytes.len() as u64).to_le_bytes());
    hasher.update(bytes);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_is_the_crc_32_of_everybody() {
        // The check value of CRC-32/ISO-HDLC in the catalogue of parametrised CRC algorithms.
        assert_eq!(crc32fast::hash(b"123456789"), 0xCBF4_3926);
        // Kind 3, a length of eight bytes, then the text.
        assert_eq!(sum_of(&[&"abc"]).unwrap(), i64::from(crc32fast::hash(b"\x03\x03\0\0\0\0\0\0\0abc")));
    }

    #[test]
    fn values_do_not_run_together() {
        let sums = [
            sum_of(&[&"ab", &"c"]),
            sum_of(&[&"a", &"bc"]),
            sum_of(&[&"abc", &""]),
            sum_of(&[&"abc"]),
            sum_of(&[&1_i64]),
            sum_of(&[&1.0]),
            sum_of(&[&None::<i64>]),
        ];
        let different: std::collections::BTreeSet<i64> = sums.into_iter().map(Result::unwrap).collect();
        assert_eq!(different.len(), 7);
        assert_eq!(sum_of(&[&0.0]).unwrap(), sum_of(&[&-0.0]).unwrap());
    }
}
