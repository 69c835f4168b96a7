//! From the text of a condition to its steps, with all that is wrong in it.

use syn::spanned::Spanned;
use syn::{BinOp, Expr, ExprBinary, ExprCall, Lit, UnOp};
use types::value::{Mistake, Span};

use super::super::signal::{Kind, of_truth};
use super::look::looked_over;
use super::words::Words;
use super::{Condition, DEEPEST, EXAMPLE, One, Op, Two, too_deep};

const COMPARE: &str = "compare it, as in battery < 0.2";
const FUNCTIONS: [&str; 4] = ["min", "max", "abs", "known"];

/// Reads a condition.
///
/// # Errors
/// All mistakes, their places counted from the beginning of the text.
pub(crate) fn compile(text: &str, words: &mut Words<'_>) -> Result<Condition, Vec<Mistake>> {
    if let Some(mistake) = looked_over(text) {
        return Err(vec![mistake]);
    }
    let mut compiler = Compiler { text, words, ops: Vec::new(), height: 0, highest: 0, mistakes: Vec::new() };
    match syn::parse_str::<Expr>(text) {
        Ok(tree) => compiler.whole(&tree),
        Err(error) => compiler.no_expression(&error),
    }
    let Compiler { ops, mistakes, .. } = compiler;
    // The parser keeps all texts of a thread for the places in them, which are no longer needed.
    proc_macro2::extra::invalidate_current_thread_spans();
    if mistakes.is_empty() { Ok(Condition(ops.into())) } else { Err(mistakes) }
}

struct Compiler<'c, 'w> {
    text: &'c str,
    words: &'c mut Words<'w>,
    ops: Vec<Op>,
    /// How many values lie on the pile after the steps so far, and how many did at most.
    height: usize,
    highest: usize,
    mistakes: Vec<Mistake>,
}

impl Compiler<'_, '_> {
    fn whole(&mut self, tree: &Expr) {
        self.expect(tree, Kind::Truth);
        if self.highest > DEEPEST && self.mistakes.is_empty() {
            self.mistakes.push(too_deep(self.everything()));
        }
    }

    fn everything(&self) -> Span {
        Span { start: 0, end: self.text.len() as u32 }
    }

    fn place(&self, of: &impl Spanned) -> Span {
        let range = of.span().byte_range();
        // What is missing at the end has no place.
        if range.is_empty() {
            self.everything()
        } else {
            Span { start: range.start as u32, end: range.end as u32 }
        }
    }

    fn no_expression(&mut self, error: &syn::Error) {
        let (said, range) = (error.to_string(), error.span().byte_range());
        let mistake = |at, what| Mistake::new(at, what);
        self.mistakes.push(if said.contains("chained") {
            mistake(self.everything(), "comparisons do not follow each other").help("write a < b && b < c")
        } else if range.is_empty() || said.starts_with("unexpected end") {
            mistake(self.everything(), "the condition ends too early").help(EXAMPLE)
        } else {
            let at = Span { start: range.start as u32, end: range.end as u32 };
            mistake(at, "the condition cannot be read from here on").help(EXAMPLE)
        });
    }

    fn put(&mut self, op: Op) {
        match op {
            Op::Number(_) | Op::Signal(_) | Op::Known(_) => self.height += 1,
            Op::One(_) => {}
            // Where something was wrong there may be fewer.
            Op::Two(_) => self.height = self.height.saturating_sub(1),
        }
        self.highest = self.highest.max(self.height);
        self.ops.push(op);
    }

    /// Writes the steps of an expression that must be of a kind.
    fn expect(&mut self, tree: &Expr, wanted: Kind) {
        let Some(found) = self.term(tree) else { return };
        let at = self.place(tree);
        match wanted {
            _ if found == wanted => {}
            Kind::Truth => {
                self.mistakes.push(Mistake::new(at, "this is a number, not a condition").help(COMPARE));
            }
            Kind::Number => self.mistakes.push(Mistake::new(at, "this is a condition, not a number")),
        }
    }

    /// Writes the steps of an expression, and says of what kind it is where that can be told.
    fn term(&mut self, tree: &Expr) -> Option<Kind> {
        match tree {
            Expr::Lit(literal) => self.literal(tree, &literal.lit),
            Expr::Paren(inner) => self.term(&inner.expr),
            Expr::Path(_) if word(tree).is_some() => {
                let (place, kind) = self.signal(tree)?;
                self.put(Op::Signal(place));
                Some(kind)
            }
            Expr::Unary(unary) => match unary.op {
                UnOp::Neg(_) => Some(self.one(&unary.expr, One::Minus)),
                UnOp::Not(_) => Some(self.one(&unary.expr, One::Not)),
                _ => self.nothing(tree),
            },
            Expr::Binary(binary) => self.binary(binary),
            Expr::Call(call) => self.call(call),
            _ => self.nothing(tree),
        }
    }

    fn nothing(&mut self, tree: &Expr) -> Option<Kind> {
        let mistake = Mistake::new(self.place(tree), "this means nothing in a condition");
        self.mistakes.push(match tree {
            Expr::Field(_) => mistake.help("names of signals have no dots"),
            _ => mistake.help(EXAMPLE),
        });
        None
    }

    fn literal(&mut self, tree: &Expr, literal: &Lit) -> Option<Kind> {
        let (number, suffix) = match literal {
            Lit::Bool(truth) => {
                self.put(Op::Number(of_truth(truth.value)));
                return Some(Kind::Truth);
            }
            Lit::Int(int) => (int.base10_digits().parse().ok(), int.suffix()),
            Lit::Float(float) => (float.base10_digits().parse().ok(), float.suffix()),
            _ => return self.nothing(tree),
        };
        match number {
            Some(number) if suffix.is_empty() => self.put(Op::Number(number)),
            _ => self.mistakes.push(Mistake::new(self.place(tree), "a number has no letters behind it")),
        }
        Some(Kind::Number)
    }

    /// The place of a signal, and what it is.
    fn signal(&mut self, tree: &Expr) -> Option<(usize, Kind)> {
        let found = self.words.find(&word(tree)?, self.place(tree));
        found.map_err(|mistake| self.mistakes.push(mistake)).ok()
    }

    fn one(&mut self, of: &Expr, one: One) -> Kind {
        let kind = if one == One::Not { Kind::Truth } else { Kind::Number };
        self.expect(of, kind);
        self.put(Op::One(one));
        kind
    }

    fn two(&mut self, a: &Expr, b: &Expr, two: Two) -> Kind {
        use Two::{Add, And, Divide, Max, Min, Multiply, Or, Subtract};
        let takes = if matches!(two, And | Or) { Kind::Truth } else { Kind::Number };
        self.expect(a, takes);
        self.expect(b, takes);
        self.put(Op::Two(two));
        let gives_number = matches!(two, Add | Subtract | Multiply | Divide | Min | Max);
        if gives_number { Kind::Number } else { Kind::Truth }
    }

    fn binary(&mut self, binary: &ExprBinary) -> Option<Kind> {
        let two = match &binary.op {
            BinOp::Add(_) => Two::Add,
            BinOp::Sub(_) => Two::Subtract,
            BinOp::Mul(_) => Two::Multiply,
            BinOp::Div(_) => Two::Divide,
            BinOp::Lt(_) => Two::Less,
            BinOp::Le(_) => Two::LessOrEqual,
            BinOp::Gt(_) => Two::Greater,
            BinOp::Ge(_) => Two::GreaterOrEqual,
            BinOp::Eq(_) => Two::Equal,
            BinOp::Ne(_) => Two::Unequal,
            BinOp::And(_) => Two::And,
            BinOp::Or(_) => Two::Or,
            other => {
                let mistake = Mistake::new(self.place(binary), "there is no such operator");
                self.mistakes.push(match other {
                    BinOp::BitAnd(_) => mistake.help("did you mean \"&&\"?"),
                    BinOp::BitOr(_) => mistake.help("did you mean \"||\"?"),
                    _ => mistake.help(EXAMPLE),
                });
                return None;
            }
        };
        Some(self.two(&binary.left, &binary.right, two))
    }

    fn call(&mut self, call: &ExprCall) -> Option<Kind> {
        let name = word(&call.func).unwrap_or_default();
        let given: Vec<&Expr> = call.args.iter().collect();
        match (name.as_str(), given.as_slice()) {
            ("min", [a, b]) => Some(self.two(a, b, Two::Min)),
            ("max", [a, b]) => Some(self.two(a, b, Two::Max)),
            ("abs", [a]) => Some(self.one(a, One::Abs)),
            ("known", [a]) => self.known(a),
            (known, _) if FUNCTIONS.contains(&known) => {
                let takes = if matches!(known, "min" | "max") { "2 values" } else { "1 value" };
                let what = format!("{known} takes {takes}, not {}", given.len());
                self.mistakes.push(Mistake::new(self.place(call), what));
                None
            }
            (unknown, _) => {
                let at = self.place(&call.func);
                self.mistakes.push(Mistake::unknown(at, "function", unknown, FUNCTIONS));
                None
            }
        }
    }

    fn known(&mut self, of: &Expr) -> Option<Kind> {
        if word(of).is_none() {
            self.mistakes.push(Mistake::new(self.place(of), "known takes the name of a signal"));
            return None;
        }
        let (place, _) = self.signal(of)?;
        self.put(Op::Known(place));
        Some(Kind::Truth)
    }
}

/// The word, where an expression is no more than that.
fn word(tree: &Expr) -> Option<String> {
    match tree {
        Expr::Path(path) => path.path.get_ident().map(ToString::to_string),
        _ => None,
    }
}
