//! The best cost known of each state: a hash table with open addressing that is emptied at no cost.

/// Marks slots of an earlier search.
#[derive(Debug, Clone, Copy, Default)]
struct Slot {
    key: u64,
    cost: u32,
    search: u32,
}

/// State → least cost.
#[derive(Debug)]
pub(crate) struct Closed {
    slots: Vec<Slot>,
    search: u32,
    used: usize,
}

impl Closed {
    pub(crate) fn new() -> Self {
        Self { slots: vec![Slot::default(); 1 << 14], search: 1, used: 0 }
    }

    /// Forgets everything.
    pub(crate) fn clear(&mut self) {
        self.used = 0;
        self.search = self.search.wrapping_add(1);
        if self.search == 0 {
            self.slots.fill(Slot::default());
            self.search = 1;
        }
    }

    /// The least cost known.
    #[inline]
    pub(crate) fn get(&self, key: u64) -> Option<u32> {
        let slot = &self.slots[self.place(key)];
        (slot.search == self.search).then_some(slot.cost)
    }

    /// Remembers a cost.
    #[inline]
    pub(crate) fn put(&mut self, key: u64, cost: u32) {
        if self.used * 2 >= self.slots.len() {
            self.grow();
        }
        let place = self.place(key);
        let slot = &mut self.slots[place];
        if slot.search != self.search {
            self.used += 1;
        }
        *slot = Slot { key, cost, search: self.search };
    }

    /// Where the key is, or belongs.
    #[inline]
    fn place(&self, key: u64) -> usize {
        let mask = self.slots.len() - 1;
        let mut place = (key.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 32) as usize & mask;
        while self.slots[place].search == self.search && self.slots[place].key != key {
            place = (place + 1) & mask;
        }
        place
    }

    fn grow(&mut self) {
        let larger = vec![Slot::default(); self.slots.len() * 2];
        let old = std::mem::replace(&mut self.slots, larger);
        for slot in old.into_iter().filter(|slot| slot.search == self.search) {
            let place = self.place(slot.key);
            self.slots[place] = slot;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_put_is_there_until_it_is_cleared() {
        let mut closed = Closed::new();
        for key in 0..50_000_u64 {
            closed.put(key * 7919, key as u32);
        }
        assert!((0..50_000_u64).all(|key| closed.get(key * 7919) == Some(key as u32)));
        assert_eq!(closed.get(1), None);
        closed.put(0, 77);
        assert_eq!(closed.get(0), Some(77));
        closed.clear();
        assert_eq!(closed.get(0), None);
    }
}
