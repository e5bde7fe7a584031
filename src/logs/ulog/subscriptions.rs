//! The subscriptions of a ULog (a log of PX4). Each record has a message number, and a subscription assigns a topic to it.

use std::collections::BTreeMap;
use std::rc::Rc;

use super::RECORD;
use super::layout::Layout;
use crate::topics::Topic;

/// The topic of one message number. `key` is the name of the topic and its instance.
pub(super) struct Subscription {
    pub key: (String, u16),
    pub layout: Rc<Layout>,
    /// Index of its records in the [`Series`]; `None` before the first record.
    pub place: Option<usize>,
    pub count: usize,
}

impl Subscription {
    /// Whether a record of `len` bytes has the size that the topic's format states; `None` if the file lacks the format.
    pub fn fits(&self, len: usize) -> Option<bool> {
        let sizes = RECORD + 2 + self.layout.size..=RECORD + 2 + self.layout.padded;
        (self.layout.size > 0).then(|| sizes.contains(&len))
    }
}

/// The records of the topics, with one series for each topic and instance. All subscriptions of the same topic and instance
/// add to the same series.
#[derive(Default)]
pub(super) struct Series {
    places: BTreeMap<(String, u16), usize>,
    topics: Vec<Topic>,
}

impl Series {
    /// Index of the series of `key`. If there is none yet, `new` makes it.
    pub fn place(&mut self, key: &(String, u16), new: impl FnOnce() -> Topic) -> usize {
        if let Some(place) = self.places.get(key) {
            return *place;
        }
        self.topics.push(new());
        self.places.insert(key.clone(), self.topics.len() - 1);
        self.topics.len() - 1
    }

    /// The series at an index that [`Series::place`] returned.
    pub fn at(&mut self, place: usize) -> &mut Topic {
        &mut self.topics[place]
    }

    /// The series that have records, by topic and instance.
    pub fn all(mut self) -> BTreeMap<(String, u16), Topic> {
        let taken = self.places.into_iter();
        let taken = taken.map(|(key, place)| (key, std::mem::take(&mut self.topics[place])));
        taken.filter(|(_, topic)| !topic.time_s.is_empty()).collect()
    }
}

/// The subscriptions by message number. Each record needs several look-ups, so they are made by array index.
#[derive(Default)]
pub(super) struct Subscriptions {
    /// Position of each message number in `all`, counted from 1; 0 for a number without a subscription.
    places: Vec<u16>,
    pub all: Vec<(u16, Subscription)>,
}

impl Subscriptions {
    fn place(&self, number: u16) -> Option<usize> {
        usize::from(*self.places.get(usize::from(number))?).checked_sub(1)
    }

    pub fn get(&self, number: u16) -> Option<&Subscription> {
        Some(&self.all[self.place(number)?].1)
    }

    pub fn get_mut(&mut self, number: u16) -> Option<&mut Subscription> {
        let place = self.place(number)?;
        Some(&mut self.all[place].1)
    }

    /// Sets the subscription of `number` and returns the previous one. A new number is ignored if 65,535 others are in use.
    pub fn insert(&mut self, number: u16, new: Subscription) -> Option<Subscription> {
        if let Some(old) = self.get_mut(number) {
            return Some(std::mem::replace(old, new));
        }
        let place = u16::try_from(self.all.len() + 1).ok()?;
        let needed = usize::from(number) + 1;
        self.places.resize(self.places.len().max(needed), 0);
        self.places[usize::from(number)] = place;
        self.all.push((number, new));
        None
    }
}
