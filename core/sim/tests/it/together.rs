//! Several robots and traffic control: everybody arrives, nobody touches anybody.

use crate::meetings::{Door, Meeting, circle};

fn all_arrive(made: &Meeting) {
    let ok = made.reached == made.ends.len() && made.contacts == 0 && made.is_brisk();
    assert!(ok, "{:#?}", Meeting { tracks: Vec::new(), ..made.clone() });
}

#[test]
fn four_swap_across_a_circle() {
    all_arrive(&circle(4, 1, &mut |_, _| {}));
}

#[test]
fn five_swap_through_a_door() {
    let mut door = Door::new(1);
    (0..2).for_each(|_| all_arrive(&door.round(&mut |_, _| {})));
}
