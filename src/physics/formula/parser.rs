//! Parser of formulas, from text to expression tree.

use super::expression::{Expression, Function, Node};
use super::variable::Variable;

/// Longest formula, bytes.
const LONGEST: usize = 2000;
/// Largest number of nodes in a formula.
const MOST_NODES: usize = 400;
/// Deepest nesting of parentheses, signs and function calls.
const DEEPEST: usize = 40;
/// Largest accepted magnitude of an integer power.
const LARGEST_POWER: i16 = 8;

/// A fault in a formula, with its position.
#[derive(Clone, Debug, PartialEq)]
pub struct Fault {
    /// Byte offset in the text.
    pub at: usize,
    /// Description of the fault and its remedy.
    pub why: String,
}

type Parsed = Result<Expression, Fault>;

/// Parses `text`. Names in `parameters` take precedence over variables.
///
/// # Errors
/// If `text` is not a valid formula. The error has the position, the fault and the remedy.
pub fn parse(text: &str, parameters: &[&str]) -> Parsed {
    if text.len() > LONGEST {
        let why = format!(
            "the formula has {} bytes, {LONGEST} are the most; divide it into several channels or effects",
            text.len()
        );
        return Err(Fault { at: LONGEST, why });
    }
    let mut parser = Parser { text, at: 0, parameters, depth: 0, nodes: 0 };
    let formula = parser.sum()?;
    match parser.peek() {
        None => Ok(formula),
        Some(')') => {
            Err(parser.fault("this bracket closes nothing; take it out or open it before"))
        }
        Some(other) => Err(parser.fault(&format!(
            "{other:?} is not expected here; write an operator (+ - * / ^) between two terms"
        ))),
    }
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    parameters: &'a [&'a str],
    depth: usize,
    nodes: usize,
}

impl Parser<'_> {
    fn fault(&self, why: &str) -> Fault {
        Fault { at: self.at, why: why.into() }
    }

    fn rest(&self) -> &str {
        &self.text[self.at..]
    }

    /// Skips spaces and returns the next character without consuming it.
    fn peek(&mut self) -> Option<char> {
        let rest = self.rest();
        self.at += rest.len() - rest.trim_start().len();
        self.rest().chars().next()
    }

    fn take(&mut self, wanted: char) -> bool {
        let found = self.peek() == Some(wanted);
        self.at += if found { wanted.len_utf8() } else { 0 };
        found
    }

    fn node(&mut self, node: Node, at: usize) -> Parsed {
        self.nodes += 1;
        if self.nodes > MOST_NODES {
            let why = format!(
                "the formula has more than {MOST_NODES} terms; divide it into several effects"
            );
            return Err(Fault { at, why });
        }
        Ok(Expression { node, at })
    }

    fn call(&mut self, function: Function, arguments: Vec<Expression>, at: usize) -> Parsed {
        self.node(Node::Call(function, arguments), at)
    }

    fn sum(&mut self) -> Parsed {
        let mut left = self.product()?;
        loop {
            let function = match self.peek() {
                Some('+') => Function::Add,
                Some('-' | '−') => Function::Subtract,
                _ => return Ok(left),
            };
            self.skip();
            let right = self.product()?;
            let at = left.at;
            left = self.call(function, vec![left, right], at)?;
        }
    }

    fn skip(&mut self) {
        self.at += self.rest().chars().next().map_or(0, char::len_utf8);
    }

    fn product(&mut self) -> Parsed {
        let mut left = self.signed()?;
        loop {
            let function = match self.peek() {
                Some('*' | '·') => Function::Multiply,
                Some('/') => Function::Divide,
                _ => return Ok(left),
            };
            self.skip();
            let right = self.signed()?;
            let at = left.at;
            left = self.call(function, vec![left, right], at)?;
        }
    }

    fn signed(&mut self) -> Parsed {
        self.deeper()?;
        let at = self.at;
        let signed = if self.take('-') || self.take('−') {
            let of = self.signed()?;
            match of.node {
                Node::Number(x) => Ok(Expression { node: Node::Number(-x), at }),
                _ => self.call(Function::Negate, vec![of], at),
            }
        } else if self.take('+') {
            self.signed()
        } else {
            self.power()
        };
        self.depth -= 1;
        signed
    }

    fn deeper(&mut self) -> Result<(), Fault> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(self.fault("the brackets are nested too deeply; divide the formula"));
        }
        Ok(())
    }

    fn power(&mut self) -> Parsed {
        let base = self.atom()?;
        let raised = match self.peek() {
            Some('²') => Some(2),
            Some('³') => Some(3),
            _ => None,
        };
        if let Some(n) = raised {
            self.skip();
            return self.raise(base, n);
        }
        if !self.take('^') {
            return Ok(base);
        }
        let bracket = self.take('(');
        let sign = if self.take('-') || self.take('−') { -1 } else { 1 };
        self.peek();
        let digits: String = self.rest().chars().take_while(char::is_ascii_digit).collect();
        let whole = digits.parse::<i16>().ok().filter(|n| *n <= LARGEST_POWER);
        let Some(n) = whole else {
            return Err(self.fault(&format!(
                "a power must be a whole number up to {LARGEST_POWER}; for others write exp, sqrt or a table"
            )));
        };
        self.at += digits.len();
        if self.rest().starts_with(['.', 'e', 'E']) {
            return Err(self.fault("a power must be a whole number; for a root write sqrt(x)"));
        }
        if bracket && !self.take(')') {
            return Err(self.fault("the bracket of the power is not closed; write )"));
        }
        self.raise(base, sign * n)
    }

    fn raise(&mut self, base: Expression, n: i16) -> Parsed {
        let at = base.at;
        self.node(Node::Power(Box::new(base), n), at)
    }

    fn atom(&mut self) -> Parsed {
        let Some(next) = self.peek() else {
            return Err(self.fault("the formula ends where a term is expected; write one, or take the operator before out"));
        };
        let at = self.at;
        match next {
            '(' => self.bracket(),
            '0'..='9' | '.' => {
                let x = self.number()?;
                self.node(Node::Number(x), at)
            }
            c if c.is_alphabetic() || c == '_' => self.named(),
            c => Err(self
                .fault(&format!("{c:?} is not expected here; a number, a name or a bracket is"))),
        }
    }

    fn bracket(&mut self) -> Parsed {
        self.skip();
        self.deeper()?;
        let inside = self.sum()?;
        self.depth -= 1;
        if self.take(')') {
            return Ok(inside);
        }
        Err(self.fault("a bracket is not closed; write ) where it ends"))
    }

    /// A number without a sign.
    fn number(&mut self) -> Result<f64, Fault> {
        let rest = self.rest().as_bytes();
        let digit = |k: usize| rest.get(k).is_some_and(u8::is_ascii_digit);
        let mut end = 0;
        while digit(end) || rest.get(end) == Some(&b'.') {
            end += 1;
        }
        if matches!(rest.get(end), Some(b'e' | b'E')) {
            let sign = usize::from(matches!(rest.get(end + 1), Some(b'+' | b'-')));
            if digit(end + 1 + sign) {
                end += 1 + sign;
                while digit(end) {
                    end += 1;
                }
            }
        }
        let text = &self.rest()[..end];
        match text.parse::<f64>().ok().filter(|x| x.is_finite()) {
            Some(x) => {
                self.at += end;
                Ok(x)
            }
            None => {
                Err(self.fault(&format!("{text:?} is no number; write one such as 0.5 or 1e-3")))
            }
        }
    }

    fn name(&mut self) -> String {
        let part = |c: &char| c.is_alphanumeric() && !"²³".contains(*c) || *c == '_';
        let name: String = self.rest().chars().take_while(part).collect();
        self.at += name.len();
        name
    }

    fn named(&mut self) -> Parsed {
        let at = self.at;
        let name = self.name();
        if self.peek() == Some('(') {
            return self.function(&name, at);
        }
        if let Some(k) = self.parameters.iter().position(|p| *p == name) {
            return self.node(Node::Parameter(k), at);
        }
        match Variable::from_name(&name) {
            Some(variable) => self.node(Node::Variable(variable), at),
            None => Err(Fault { at, why: self.unknown(&name) }),
        }
    }

    fn unknown(&self, name: &str) -> String {
        let short: String = name.chars().take(30).collect();
        let names = Variable::ALL.iter().map(|v| v.name());
        let mut all: Vec<&str> = self.parameters.iter().copied().chain(names).collect();
        all.sort_by_key(|known| distance(known, &short));
        let near: Vec<&str> = all.iter().copied().take(3).collect();
        format!(
            "{short:?} is neither a parameter of the effect nor a variable; near it are {}; \
             `greylag effects variables` lists all",
            near.join(", ")
        )
    }

    fn function(&mut self, name: &str, at: usize) -> Parsed {
        self.skip();
        self.deeper()?;
        let made = match (name, Function::from_name(name)) {
            ("table", _) => self.table(at)?,
            ("clamp", _) => self.clamp(at)?,
            (_, Some(function)) => self.arguments(function, at)?,
            _ => return Err(Fault { at, why: no_function(name) }),
        };
        self.depth -= 1;
        Ok(made)
    }

    fn list(&mut self) -> Result<Vec<Expression>, Fault> {
        let mut all = Vec::new();
        loop {
            all.push(self.sum()?);
            if self.take(')') {
                return Ok(all);
            }
            if !self.take(',') {
                return Err(self.fault("the brackets of a function are not closed; write , or )"));
            }
        }
    }

    fn arguments(&mut self, function: Function, at: usize) -> Parsed {
        let all = self.list()?;
        let (given, wanted) = (all.len(), function.count());
        if given != wanted {
            let why = format!("{} takes {wanted} arguments, {given} are given", function.name());
            return Err(Fault { at, why });
        }
        self.call(function, all, at)
    }

    /// Parses the call clamp(x, low, high).
    fn clamp(&mut self, at: usize) -> Parsed {
        let all = self.list()?;
        let Ok([x, low, high]) = <[Expression; 3]>::try_from(all) else {
            return Err(Fault { at, why: "clamp takes 3 arguments: clamp(x, low, high)".into() });
        };
        let raised = self.call(Function::Max, vec![x, low], at)?;
        self.call(Function::Min, vec![raised, high], at)
    }

    /// Parses the call table(x; x1:y1, x2:y2, …).
    fn table(&mut self, at: usize) -> Parsed {
        let x = self.sum()?;
        if !self.take(';') {
            return Err(self.fault(
                "a table is written table(x; x1:y1, x2:y2, …); write ; after its variable",
            ));
        }
        let mut points: Vec<[f64; 2]> = Vec::new();
        loop {
            let start = self.at;
            let abscissa = self.signed_number()?;
            if !self.take(':') {
                return Err(self.fault("a table's points are written x:y; write : between them"));
            }
            let ordinate = self.signed_number()?;
            if points.last().is_some_and(|[before, _]| *before >= abscissa) {
                let why = "a table's abscissae must increase; put its points in order".into();
                return Err(Fault { at: start, why });
            }
            points.push([abscissa, ordinate]);
            self.nodes += 1;
            if self.take(')') {
                break;
            }
            if !self.take(',') {
                return Err(self.fault("the brackets of a table are not closed; write , or )"));
            }
        }
        if points.len() < 2 {
            return Err(Fault { at, why: "a table needs at least two points".into() });
        }
        self.node(Node::Table(Box::new(x), points), at)
    }

    fn signed_number(&mut self) -> Result<f64, Fault> {
        let minus = self.take('-') || self.take('−');
        self.peek();
        let x = self.number()?;
        Ok(if minus { -x } else { x })
    }
}

fn no_function(name: &str) -> String {
    let short: String = name.chars().take(30).collect();
    let known = Function::ALL.iter().filter(|f| !f.is_operator()).map(|f| f.name());
    let known: Vec<&str> = known.chain(["clamp", "table"]).collect();
    format!(
        "there is no function {short:?}; there are {}; a product needs * before the bracket",
        known.join(", ")
    )
}

/// Edit distance between two names: the number of letters to change, add or remove.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut corner = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let change = corner + usize::from(x != *y);
            corner = row[j + 1];
            row[j + 1] = change.min(row[j] + 1).min(corner + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(text: &str) -> String {
        let names = ["k", "m"];
        parse(text, &names).unwrap().written(&names).to_string()
    }

    #[test]
    fn precedence_is_that_of_mathematics() {
        for (text, meant) in [
            ("k*alpha+m*beta^2", "k*alpha + m*beta^2"),
            ("-alpha^2", "-alpha^2"),
            ("k-(m-alpha)-beta", "k - (m - alpha) - beta"),
            ("k/(m/2)/p", "k/(m/2)/p"),
            ("2·α·δe", "2*alpha*elevator"),
            ("max(0, alpha−0.1)²", "max(0, alpha - 0.1)^2"),
            ("clamp(r,-1,1)", "min(max(r, -1), 1)"),
            ("table(alpha; -0.1:0, 0.2:1e-1)*k", "table(alpha; -0.1:0, 0.2:0.1)*k"),
        ] {
            assert_eq!(written(text), meant, "{text}");
            assert_eq!(written(meant), meant, "{meant} read again");
        }
    }

    #[test]
    fn faults_say_where_and_what_to_do() {
        for (text, at, cure) in [
            ("k*alhpa", 2, "alpha"),
            ("k*(alpha", 8, "write )"),
            ("k alpha", 2, "operator"),
            ("k*", 2, "term"),
            ("k*alpha)", 7, "closes nothing"),
            ("alpha^0.5", 7, "sqrt"),
            ("alpha^99", 6, "whole number"),
            ("min(alpha)", 0, "2 arguments"),
            ("table(alpha; 0:1)", 0, "two points"),
            ("table(alpha; 0:1, 0:2)", 17, "increase"),
            ("k(alpha)", 0, "*"),
            ("lag(elevator)", 0, "2 arguments"),
            ("1e999", 0, "number"),
            ("k*alpha $", 8, "operator"),
            ("", 0, "term"),
        ] {
            let fault = parse(text, &["k"]).unwrap_err();
            assert_eq!(fault.at, at, "{text}: {fault:?}");
            assert!(fault.why.contains(cure), "{text}: {}", fault.why);
        }
        let deep = "(".repeat(500) + &")".repeat(500);
        assert!(parse(&deep, &[]).unwrap_err().why.contains("nested"));
        let long = vec!["alpha"; 390].join("+");
        assert!(parse(&long, &[]).is_err());
    }
}
