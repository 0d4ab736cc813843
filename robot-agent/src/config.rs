//! The agent's configuration: one table with defaults, over it a TOML file, over that flags and environment.
//!
//! `robot-agent --print-config` prints what is in force, each line with its unit, range and origin,
//! ready to be saved and edited. Unknown keys are errors with a suggestion: a misspelt limit must
//! not be silently the default.

mod file;
mod layers;
mod problem;

pub use file::{
    AgentConfig, AgentSection, ConfigFile, ControlSection, HardwareSection, MapSection, NavigationSection,
    Ros2, Ros2Section, StartPose, ZenohSection,
};
pub use layers::SettingLayers;
pub use problem::ConfigProblem;

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::PathBuf;
    use toml::Value;

    fn with(text: &str) -> Result<ConfigFile, ConfigProblem> {
        let mut layers = SettingLayers::default();
        layers.file("robot.toml", text)?;
        layers.finish()
    }

    #[test]
    fn the_printed_configuration_reads_back_as_itself() {
        let file = ConfigFile::default();
        assert_eq!(with(&file.to_toml()).unwrap(), file);
    }

    #[test]
    fn an_unknown_key_is_an_error_with_a_suggestion() {
        let error = with("[vehicle.speed]\nkpp = 3.0\n").unwrap_err().to_string();
        assert_eq!(error, "robot.toml: unknown key vehicle.speed.kpp; did you mean vehicle.speed.kp?");
        let error = with("[vehicel]\n").unwrap_err().to_string();
        assert!(error.ends_with("did you mean vehicle?"), "{error}");
    }

    #[test]
    fn a_value_out_of_range_names_field_value_and_range() {
        let error = with("[vehicle.goto]\ntolerance_m = 0.0\n").unwrap_err().to_string();
        assert_eq!(error, "goto.tolerance_m = 0.0 is not allowed: 0.01..=5 m");
    }

    #[test]
    fn a_setting_of_navigation_is_refused_by_its_whole_name() {
        let error = with("[navigation.drive]\nlook_ahead_m = 2.0\n").unwrap_err().to_string();
        assert_eq!(error, "navigation.drive.look_ahead_m = 2.0 is not allowed: 0.15..=0.6 m");
        let error = with("[navigation.drive]\nmeeting_mps = 0.4\n").unwrap_err().to_string();
        assert!(error.starts_with("navigation.drive.cruise_mps = 0.35 is not allowed: it must"), "{error}");
        let error = with("[navigation.pose]\ngates = 2\n").unwrap_err().to_string();
        assert!(error.ends_with("did you mean navigation.pose.gate?"), "{error}");
        // What a replay needs is in order; the truck that drives would not stop in time.
        let file = with("[vehicle.obstacle]\nthreshold_cm = 20.0\n").unwrap();
        let error = file.agent().unwrap_err().to_string();
        assert!(error.starts_with("navigation.drive.cruise_mps = 0.35 is not allowed: the 20 cm"), "{error}");
    }

    #[test]
    fn settings_of_navigation_reach_the_agent() {
        let text = "[navigation]\nmap = \"lab.yaml\"\n[navigation.drive]\ncruise_mps = 0.3\n\
                    [navigation.unknown]\nfades_s = 20\n";
        let agent = with(text).unwrap().agent().unwrap();
        assert_eq!(agent.map, Some(PathBuf::from("lab.yaml")));
        assert_eq!((agent.navigation.drive.cruise_mps, agent.navigation.unknown.fades_s), (0.3, 20.0));
    }

    #[test]
    fn real_time_is_off_unless_asked_for_and_reads_back_as_itself() {
        assert!(!ConfigFile::default().agent().unwrap().realtime);
        let file = with("[control]\nrealtime = true\n").unwrap();
        assert!(file.agent().unwrap().realtime);
        assert_eq!(with(&file.to_toml()).unwrap(), file);
        let error = with("[control]\nrealtime = 20\n").unwrap_err().to_string();
        assert!(error.contains("expected a boolean"), "{error}");
        let error = with("[control]\nreal_time = true\n").unwrap_err().to_string();
        assert!(error.ends_with("did you mean control.realtime?"), "{error}");
    }

    #[test]
    fn later_layers_win() {
        let mut layers = SettingLayers::default();
        layers.file("robot.toml", "[agent]\nname = \"red\"\nfleet = \"barn\"\n").unwrap();
        layers.set("--name", "agent.name", Value::String("blue".into())).unwrap();
        let agent = layers.finish().unwrap().agent().unwrap();
        assert_eq!((agent.robot.as_str(), agent.fleet.as_str()), ("blue", "barn"));
    }

    #[test]
    fn an_identity_gives_name_fleet_and_routers_and_excludes_others() {
        let own = "xtb-7.1".parse().unwrap();
        let routers = vec!["tls/10.0.0.1:7447".to_owned()];
        let [ca, certificate, key] = Default::default();
        let fleet = xtb_protocol::Name::new("hall").unwrap();
        let identity =
            xtb_identity::Identity::new(fleet, own, xtb_identity::Role::Robot, routers, ca, certificate, key);
        let mut file = with("[agent]\nname = \"xtb-1\"\n").unwrap(); // the default, as --print-config writes it
        file.identify(&identity).unwrap();
        let agent = file.agent().unwrap();
        assert_eq!((agent.robot.as_str(), agent.fleet.as_str()), ("xtb-7", "hall"));
        assert_eq!(agent.connect, ["tls/10.0.0.1:7447"]);
        for (text, says) in [
            ("[agent]\nname = \"xtb-2\"\n", "the robot is set to xtb-2, but the identity is of robot xtb-7"),
            ("[agent]\nfleet = \"barn\"\n", "the fleet is set to barn, but the identity is of fleet hall"),
            ("[zenoh]\nmode = \"peer\"\n", "peers have no identity, but this computer has that of xtb-7"),
            (
                "[zenoh]\nconnect = [\"tcp/a:1\"]\n",
                "tcp/a:1 has no TLS: the identity of xtb-7 is not used there",
            ),
        ] {
            assert_eq!(with(text).unwrap().identify(&identity).unwrap_err().to_string(), says);
        }
        let mut viewer = identity;
        viewer.role = xtb_identity::Role::Viewer;
        let refused = ConfigFile::default().identify(&viewer).unwrap_err().to_string();
        assert_eq!(refused, "xtb-7 is a viewer, not a robot");
    }

    #[test]
    fn a_reserved_name_is_refused() {
        let error = with("[agent]\nname = \"all\"\n").unwrap().agent().unwrap_err();
        assert!(error.to_string().contains("reserved"), "{error}");
    }

    #[test]
    fn a_serial_line_that_is_too_slow_is_refused_and_what_would_do_is_said() {
        let refused = |setting: &str| {
            with(&format!("[hardware]\nkind = \"serial\"\n{setting}\n")).unwrap_err().to_string()
        };
        let board = refused("board_baud = 9600");
        assert!(board.starts_with("hardware.board_baud = 9600 is not allowed: the frames need"), "{board}");
        assert!(board.ends_with("use at least 38400"), "{board}");
        assert!(refused("gyro_baud = 9600").contains("use at least 14400 (19200 is usual)"));
        // A shorter window needs more.
        assert!(refused("[vehicle.encoder]\nwindow_s = 0.001").contains("use at least 230400"));
        with("[hardware]\nkind = \"serial\"\nboard_baud = 38400\ngyro_baud = 14400\n").unwrap();
        with("[hardware]\nboard_baud = 9600\n").unwrap();
        // A BNO085 sends over the board's line, and has none of its own.
        let unit = "[hardware]\nkind = \"serial\"\ngyro_baud = 1200\n[vehicle]\nimu = \"bno085-rvc\"\n";
        with(unit).unwrap();
        let slow = unit.replace("gyro_baud = 1200", "board_baud = 38400");
        assert!(with(&slow).unwrap_err().to_string().ends_with("use at least 57600"));
    }

    #[test]
    fn the_table_of_rates_has_the_pwm_frames_own_period() {
        use xtb_robot::robot::PWM_FRAME_NS;
        assert_eq!(xtb_protocol::board::rates::PWM_EVERY_S, PWM_FRAME_NS as f64 * 1e-9);
    }
}
