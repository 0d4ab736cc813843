//! The simulated truck from outside: bytes in, bytes and truth out.

#![allow(clippy::unwrap_used)]

mod agent;
mod any_car;
mod approaches;
mod bno085;
mod calibration;
mod closed_loop;
mod contacts;
mod determinism;
mod docks;
mod draw;
#[allow(dead_code)] // core/chaos uses it too
mod drive;
mod faults;
mod fixed;
mod foreign;
mod goto;
mod guards;
mod hazards;
mod journeys;
mod legs;
mod levelling;
mod motion;
mod ordinary;
mod params;
mod parking;
mod parkings;
mod pillars;
mod pins;
mod planned;
mod platform;
mod poses;
mod remote;
mod sensors;
mod threads;
mod to_map;
mod trips;
mod troubled;
mod vehicles;
mod walls;
mod wheels;
mod whole_robot;
mod worlds;
