//! The MAVLink parameter protocol: clients (ground stations and offboard programs) list, read and set the companion's parameters.

use super::{Clients, Now};
use crate::autopilot::{Autopilot, Parameter, ParameterValue, Verdict};
use crate::framing::Source;
use crate::wire::answer::{self, ParameterFault};
use crate::wire::request::{ParameterKey, ParameterName};

/// Largest integer up to which all integers are exact in a 32-bit float: 2²⁴.
const EXACT: f32 = 16_777_216.0;

fn find(table: &[Parameter], name: ParameterName) -> Option<usize> {
    table.iter().position(|parameter| parameter.name.as_bytes() == name.bytes())
}

/// The value `sent`, if its type matches that of the parameter's value `table`; otherwise `None`. A whole number sent as REAL32
/// is converted for an INT32, because pymavlink's `param_set_send` sends REAL32 by default.
fn matched(table: ParameterValue, sent: Option<ParameterValue>) -> Option<ParameterValue> {
    match (table, sent?) {
        (ParameterValue::Real(_), value @ ParameterValue::Real(_)) => Some(value),
        (ParameterValue::Int(_), value @ ParameterValue::Int(_)) => Some(value),
        (ParameterValue::Int(_), ParameterValue::Real(x))
            if x.fract() == 0.0 && x.abs() <= EXACT =>
        {
            Some(ParameterValue::Int(x as i32))
        }
        _ => None,
    }
}

impl Clients {
    /// Sends the next parameters to every client that requested the list. Only a few are sent per call, because a slow link
    /// would drop the rest.
    pub(super) fn list_parameters(&mut self, now: Now, table: &[Parameter]) {
        for session in &mut self.sessions {
            for index in session.parameters_due(now.host, table.len()) {
                let message = answer::parameter_value(&table[index], index, table.len());
                session.send(&message, self.identity, &mut self.outbox);
            }
        }
    }

    pub(super) fn read_parameter(
        &mut self,
        at: usize,
        from: Source,
        key: ParameterKey,
        table: &[Parameter],
    ) {
        let found = match key {
            ParameterKey::Index(index) => (index < table.len()).then_some(index),
            ParameterKey::Name(name) => find(table, name),
        };
        let message = match (found, key) {
            (Some(index), _) => answer::parameter_value(&table[index], index, table.len()),
            (None, ParameterKey::Index(index)) => {
                let index = i16::try_from(index).unwrap_or(i16::MAX);
                answer::parameter_error(
                    ParameterName([0; 16]),
                    index,
                    ParameterFault::DoesNotExist,
                    from,
                )
            }
            (None, ParameterKey::Name(name)) => {
                answer::parameter_error(name, -1, ParameterFault::DoesNotExist, from)
            }
        };
        self.reply(at, &message);
    }

    /// Sets a parameter. If it exists, its value is always sent in reply, and after a change to all clients. A refusal is also
    /// reported by PARAM_ERROR and as text.
    pub(super) fn set_parameter(
        &mut self,
        now: Now,
        at: usize,
        from: Source,
        name: ParameterName,
        value: Option<ParameterValue>,
        autopilot: &mut dyn Autopilot,
    ) {
        let shown = String::from_utf8_lossy(name.bytes()).into_owned();
        let Some(index) = find(autopilot.parameters(), name) else {
            self.reply(at, &answer::parameter_error(name, -1, ParameterFault::DoesNotExist, from));
            self.complain(
                now,
                at,
                &format!("Parameter {shown} refused: there is none of that name"),
            );
            return;
        };
        let refusal = match matched(autopilot.parameters()[index].value, value) {
            None => Some((ParameterFault::TypeMismatch, "wrong type".to_owned())),
            Some(value) => match autopilot.set_parameter(index, value) {
                Verdict::Accepted => None,
                Verdict::Rejected(reason) | Verdict::Denied(reason) => {
                    Some((ParameterFault::OutOfRange, reason))
                }
            },
        };
        let table = autopilot.parameters();
        let echo = answer::parameter_value(&table[index], index, table.len());
        match refusal {
            None => (0..self.sessions.len()).for_each(|everybody| self.reply(everybody, &echo)),
            Some((fault, reason)) => {
                self.reply(at, &answer::parameter_error(name, -1, fault, from));
                self.reply(at, &echo);
                self.complain(now, at, &format!("Parameter {shown} refused: {reason}"));
            }
        }
    }
}
