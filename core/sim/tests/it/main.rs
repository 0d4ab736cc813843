//! The simulated truck from outside: bytes in, bytes and truth out.

#![allow(clippy::unwrap_used)]

mod agent;
mod approaches;
mod calibration;
mod chart;
mod closed_loop;
mod contacts;
mod corridors;
mod days;
mod determinism;
mod dispatched;
mod draw;
mod drive;
mod faults;
mod fixed;
mod giveway;
mod goto;
mod guards;
mod hazards;
mod journeys;
mod legs;
mod levelling;
mod lifelong;
mod meetings;
mod motion;
mod ordinary;
mod parking;
mod parkings;
mod pillars;
mod planned;
mod platform;
mod poses;
mod remote;
mod rooms;
mod sensors;
mod together;
mod trips;
mod troubled;
mod walls;
mod wheels;
mod whole_robot;
mod worlds;
