//! Numbers and tables, as people read them.

/// Rows in columns; the first `left` columns are words, the others numbers.
pub(crate) fn table<R: AsRef<[String]>>(rows: &[R], left: usize) -> String {
    let mut widths = Vec::new();
    for row in rows.iter().map(AsRef::as_ref) {
        widths.resize(row.len().max(widths.len()), 0);
        for (width, cell) in widths.iter_mut().zip(row) {
            *width = (*width).max(cell.chars().count());
        }
    }
    let mut out = String::new();
    for row in rows.iter().map(AsRef::as_ref) {
        let mut line = String::from("  ");
        for (i, (cell, width)) in row.iter().zip(widths.iter().copied()).enumerate() {
            line += &if i < left { format!("{cell:<width$}  ") } else { format!("{cell:>width$}  ") };
        }
        out += line.trim_end();
        out.push('\n');
    }
    out
}

/// A span of time in nanoseconds, as people read it.
pub(crate) fn span(nanos: f64) -> String {
    match nanos {
        n if n <= 0.0 => "0".to_owned(),
        n if n < 1e3 => format!("{n:.0} ns"),
        n if n < 1e5 => format!("{:.1} µs", n * 1e-3),
        n if n < 1e6 => format!("{:.0} µs", n * 1e-3),
        n if n < 1e9 => format!("{:.1} ms", n * 1e-6),
        n => format!("{:.2} s", n * 1e-9),
    }
}

/// A time in seconds, as people read it.
pub(crate) fn seconds(seconds: f64) -> String {
    let text = format!("{seconds:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    format!("{text} s")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_are_read_with_their_unit() {
        assert_eq!(
            [0.0, 999.0, 1500.0, 250_000.0, 2.5e6, 3e9].map(span),
            ["0", "999 ns", "1.5 µs", "250 µs", "2.5 ms", "3.00 s"].map(str::to_owned)
        );
        assert_eq!([30.0, 30.1, 0.25].map(seconds), ["30 s", "30.1 s", "0.25 s"].map(str::to_owned));
    }

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let rows = [["a", "n"], ["long", "10"]].map(|row| row.map(str::to_owned));
        assert_eq!(table(&rows, 1), "  a      n\n  long  10\n");
    }
}
