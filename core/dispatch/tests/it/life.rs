//! A task's life, one event at a time.
