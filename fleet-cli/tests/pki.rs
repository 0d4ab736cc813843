//! `pki` and `enrol` as a shell sees them, in an empty home.

#![allow(clippy::unwrap_used)]

use assert_cmd::Command;
use assert_cmd::assert::Assert;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use xtb_identity::certificate::Certificate;
use xtb_identity::{Identity, Registry, Role};
use xtb_protocol::Name;

struct Home(TempDir);

impl Home {
    fn empty() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// With a PKI for the router 10.0.0.1.
    fn with_pki() -> Self {
        let home = Self::empty();
        home.run("pki init --router-name 10.0.0.1").code(0);
        home
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn file(&self, name: &str) -> PathBuf {
        self.path().join(name)
    }

    fn command(&self, line: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_fleet-cli"));
        command.env_clear().env("HOME", self.path()).current_dir(self.path());
        command.args(line.split_whitespace());
        command
    }

    fn run(&self, line: &str) -> Assert {
        self.command(line).assert()
    }

    fn registry(&self) -> Registry {
        Registry::parse(&read(&self.file(".config/xtb/pki/identities.toml"))).unwrap()
    }
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

fn mode(path: &Path) -> u32 {
    std::fs::metadata(path).unwrap().permissions().mode() & 0o777
}

fn stdout(assert: &Assert) -> String {
    String::from_utf8(assert.get_output().stdout.clone()).unwrap()
}

fn stderr(assert: &Assert) -> String {
    String::from_utf8(assert.get_output().stderr.clone()).unwrap()
}

fn json(assert: &Assert) -> serde_json::Value {
    serde_json::from_str(&stdout(assert)).unwrap()
}

fn identity(path: &Path) -> Identity {
    Identity::parse(&read(path)).unwrap()
}

#[test]
fn init_makes_a_ca_and_a_router_and_does_not_do_it_twice() {
    let home = Home::empty();
    let made = json(&home.run("pki init --router-name 10.0.0.1 --router-name lab-pc.local --json").code(0));
    let names = ["10.0.0.1", "lab-pc.local", "localhost", "127.0.0.1", "::1"];
    assert_eq!(made["router_names"], serde_json::json!(names));
    assert_eq!(made["endpoints"], serde_json::json!(["tls/10.0.0.1:7447", "tls/lab-pc.local:7447"]));
    let pki = home.file(".config/xtb/pki");
    assert_eq!(
        (mode(&pki), mode(&pki.join("ca.key")), mode(&pki.join("router/key.pem"))),
        (0o700, 0o600, 0o600)
    );
    let router = Certificate::parse(&read(&pki.join("router/certificate.pem"))).unwrap();
    assert_eq!(
        (router.subject.as_str(), router.hosts.as_slice()),
        ("router.1", &names.map(str::to_owned)[..])
    );
    let again = stderr(&home.run("pki init").code(1));
    assert!(again.contains("already has a PKI") && again.contains("hint: `fleet-cli pki list`"), "{again}");
    let bad = stderr(&home.run("pki init --pki other --router-name tls/10.0.0.1").code(2));
    assert!(bad.contains("\"tls/10.0.0.1\" is neither a host name nor an address"), "{bad}");
    home.run("pki init --pki other").code(0);
    let none = stderr(&home.run("pki list --pki nowhere").code(2));
    assert!(none.contains("nowhere has no PKI") && none.contains("pki init"), "{none}");
}

#[test]
fn an_identity_is_one_file_that_is_not_overwritten() {
    let home = Home::with_pki();
    let said = stdout(&home.run("pki add-robot xtb-1").code(0));
    assert!(said.starts_with("xtb-1.xtbid: robot xtb-1 of fleet lab, certificate 1 until "), "{said}");
    assert!(said.contains("`robot-agent enrol xtb-1.xtbid`"), "{said}");
    assert_eq!(mode(&home.file("xtb-1.xtbid")), 0o600);
    let robot = identity(&home.file("xtb-1.xtbid"));
    assert_eq!((robot.role, robot.routers.as_slice()), (Role::Robot, &["tls/10.0.0.1:7447".to_owned()][..]));
    let again = stderr(&home.run("pki add-robot xtb-1").code(1));
    assert!(again.contains("xtb-1.xtbid already exists"), "{again}");
    let twice = stderr(&home.run("pki add-robot xtb-1 --force").code(1));
    assert!(twice.contains("two identities have the name xtb-1") && twice.contains("renew xtb-1"), "{twice}");
    for (line, reason) in [
        ("pki add-person al-ice --role operator", "a person's name has no -"),
        ("pki add-person web --role viewer", "it is reserved"),
        ("pki add-person alice", "--role"),
        ("pki add-person alice --role robot", "operator"),
        ("pki add-robot all", "reserved"),
        ("pki add-service traffic --address 10.0.0.1", "no page"),
    ] {
        let said = stderr(&home.run(line).code(2));
        assert!(said.contains(reason), "{line}: {said}");
    }
    let left: Vec<_> = std::fs::read_dir(home.path()).unwrap().map(|it| it.unwrap().file_name()).collect();
    assert_eq!(left.len(), 2, "{left:?}"); // .config and xtb-1.xtbid
}

#[test]
fn services_have_their_roles_names_and_a_dashboard_its_page() {
    let home = Home::with_pki();
    for role in ["dispatcher", "traffic", "map", "tracker", "recorder", "simulator"] {
        home.run(&format!("pki add-service {role} --out out")).code(1); // there is no such folder
        std::fs::create_dir_all(home.file("out")).unwrap();
        home.run(&format!("pki add-service {role} --out out")).code(0);
        assert!(identity(&home.file(&format!("out/{role}.xtbid"))).page.is_none());
        std::fs::remove_dir_all(home.file("out")).unwrap();
    }
    home.run("pki add-service dashboard --address lab-pc.local").code(0);
    let page = identity(&home.file("dashboard.xtbid")).page.unwrap();
    assert_eq!(Certificate::parse(&page.certificate).unwrap().hosts[0], "lab-pc.local");
    home.run("pki renew dashboard --force").code(0);
    let next = identity(&home.file("dashboard.xtbid"));
    assert_eq!(next.generation, 2);
    let hosts = Certificate::parse(&next.page.unwrap().certificate).unwrap().hosts;
    assert_eq!(hosts, ["lab-pc.local", "localhost", "127.0.0.1", "::1"]);
}

#[test]
fn another_router_of_the_mesh_gets_a_folder_without_the_ca_key() {
    let home = Home::with_pki();
    home.run("pki add-router hall --router-name 10.0.1.1").code(0);
    let hall = home.file("hall");
    let certificate = Certificate::parse(&read(&hall.join("router/certificate.pem"))).unwrap();
    assert_eq!((certificate.subject.as_str(), certificate.hosts[0].as_str()), ("hall.1", "10.0.1.1"));
    assert_eq!(Registry::parse(&read(&hall.join("identities.toml"))).unwrap(), home.registry());
    assert!(!hall.join("ca.key").exists() && hall.join("ca.pem").exists());
    let copy = stderr(&home.run("pki add-robot xtb-1 --pki hall").code(2));
    assert!(copy.contains("it is a copy for a router"), "{copy}");
    home.run("pki add-robot xtb-1").code(0);
    assert_eq!(identity(&home.file("xtb-1.xtbid")).routers, ["tls/10.0.0.1:7447", "tls/10.0.1.1:7447"]);
}

#[test]
fn renewing_and_revoking_end_what_was_before() {
    let home = Home::with_pki();
    home.run("pki add-person alice --role operator").code(0);
    let said = stdout(&home.run("pki renew alice --days 10 --force").code(0));
    assert!(
        said.contains("certificate 2") && said.contains("Certificate 1 is not admitted any more"),
        "{said}"
    );
    home.run("pki token alice").code(0);
    let said = stdout(&home.run("pki revoke alice").code(0));
    assert!(said.starts_with("alice (operator) is revoked") && said.contains("teleoperation"), "{said}");
    assert!(stdout(&home.run("pki revoke alice").code(0)).contains("was revoked already"));
    let listed = json(&home.run("pki list --json").code(0));
    let alice = &listed["identities"][0];
    assert_eq!(
        (&alice["role"], &alice["generation"], &alice["revoked"], &alice["token"]),
        (&"operator".into(), &2.into(), &true.into(), &false.into())
    );
    assert!(stderr(&home.run("pki renew alice --force").code(1)).contains("hint: --readmit"));
    home.run("pki renew alice --force --readmit --days -1").code(0);
    let alice = &json(&home.run("pki list --json").code(0))["identities"][0];
    assert_eq!((&alice["revoked"], &alice["expired"]), (&false.into(), &true.into()));
    for line in ["pki renew bob", "pki revoke bob", "pki token bob", "pki export --browser bob --out b.p12"] {
        let said = stderr(&home.run(line).code(2));
        assert!(said.contains("no identity has the name bob") && said.contains("pki list"), "{line}: {said}");
    }
    home.run("pki renew --router --router-name 10.0.0.2").code(0);
    let router = home.registry().router;
    assert_eq!((router.generation, router.names[0].as_str()), (2, "10.0.0.2"));
}

#[test]
fn when_an_identity_was_seen_is_told_as_far_as_the_router_wrote_it() {
    let home = Home::with_pki();
    home.run("pki add-person alice --role viewer").code(0);
    std::fs::write(home.file(".config/xtb/pki/seen.toml"), "alice = \"2026-01-02T03:04:05Z\"\n").unwrap();
    let text = stdout(&home.run("pki list").code(0));
    let line = text.lines().find(|line| line.contains("alice")).unwrap();
    assert!(
        line.contains("viewer") && line.contains("valid") && line.contains("2026-01-02T03:04:05Z"),
        "{text}"
    );
    assert!(text.contains("fleet lab, tls/10.0.0.1:7447"), "{text}");
}

#[test]
fn a_token_is_shown_once_and_kept_as_its_digest() {
    let home = Home::with_pki();
    home.run("pki add-person alice --role viewer").code(0);
    home.run("pki add-robot xtb-1").code(0);
    let token = stdout(&home.run("pki token alice").code(0)).trim().to_owned();
    assert!(token.len() == 32 && token.bytes().all(|byte| byte.is_ascii_hexdigit()), "{token}");
    let registry = home.registry();
    let alice = registry.get(&Name::new("alice").unwrap()).unwrap();
    assert!(alice.has_token(&token) && !read(&home.file(".config/xtb/pki/identities.toml")).contains(&token));
    let other = json(&home.run("pki token alice --json").code(0));
    assert!(!home.registry().identities[0].has_token(&token));
    assert!(home.registry().identities[0].has_token(other["token"].as_str().unwrap()));
    assert!(stderr(&home.run("pki token xtb-1").code(2)).contains("only people sign in"));
    home.run("pki token alice --remove").code(0);
    assert_eq!(home.registry().identities[0].token_sha256, None);
}

#[test]
fn a_browser_certificate_opens_with_its_password() {
    let home = Home::with_pki();
    home.run("pki add-person alice --role operator").code(0);
    let made = json(&home.run("pki export --browser alice --out alice.p12 --json").code(0));
    let password = made["password"].as_str().unwrap();
    assert_eq!(mode(&home.file("alice.p12")), 0o600);
    let bytes = std::fs::read(home.file("alice.p12")).unwrap();
    let strict = p12_keystore::Pkcs12ImportPolicy::Strict;
    let store = p12_keystore::KeyStore::from_pkcs12(&bytes, password, strict).unwrap();
    let (alias, chain) = store.private_key_chain().unwrap();
    assert_eq!((alias, chain.certs().len()), ("alice", 2));
    assert!(chain.certs()[0].subject().contains("alice.1"), "{}", chain.certs()[0].subject());
    home.run("pki export --browser alice --out alice.p12").code(1);
    let mut command = home.command("pki export --browser alice --out alice.p12 --force");
    let said = stdout(&command.env("XTB_P12_PASSWORD", "correct horse").assert().code(0));
    assert!(said.contains("password as in XTB_P12_PASSWORD") && !said.contains("horse"), "{said}");
    let bytes = std::fs::read(home.file("alice.p12")).unwrap();
    p12_keystore::KeyStore::from_pkcs12(&bytes, "correct horse", strict).unwrap();
}

#[test]
fn runs_at_the_same_time_lose_nothing() {
    let home = Home::with_pki();
    let runs: Vec<_> = (1..=8)
        .map(|number| {
            let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_fleet-cli"));
            command.env_clear().env("HOME", home.path()).current_dir(home.path());
            command.args(["pki", "add-robot", &format!("xtb-{number}")]).stdout(std::process::Stdio::null());
            command.spawn().unwrap()
        })
        .collect();
    for mut run in runs {
        assert!(run.wait().unwrap().success());
    }
    assert_eq!(home.registry().identities.len(), 8);
}

#[test]
fn enrolling_makes_a_private_folder_and_says_what_it_is() {
    let home = Home::with_pki();
    home.run("pki add-person alice --role viewer").code(0);
    home.run("pki add-person bob --role operator").code(0);
    home.run("pki add-robot xtb-1").code(0);
    let enrolled = home.run("enrol alice.xtbid").code(0);
    let said = stdout(&enrolled);
    assert!(said.starts_with("alice, viewer of fleet lab: may look and call an emergency stop\n"), "{said}");
    assert!(said.contains("router tls/10.0.0.1:7447") && said.contains("Next: `fleet-cli list`"), "{said}");
    assert!(stderr(&enrolled).contains("still holds the private key"), "{}", stderr(&enrolled));
    let folder = home.file(".config/xtb/identity");
    assert_eq!((mode(&folder), mode(&folder.join("key.pem"))), (0o700, 0o600));
    let robot = stderr(&home.run("enrol xtb-1.xtbid").code(2));
    assert!(robot.contains("xtb-1 is a robot") && robot.contains("robot-agent enrol xtb-1.xtbid"), "{robot}");
    let other = stderr(&home.run("enrol bob.xtbid").code(1));
    assert!(other.contains("has the identity of alice of fleet lab already"), "{other}");
    std::fs::set_permissions(home.file("bob.xtbid"), std::fs::Permissions::from_mode(0o644)).unwrap();
    let bob = home.run("enrol bob.xtbid --to bob --remove").code(0);
    assert!(stderr(&bob).contains("bob.xtbid can be read by others (mode 0644)"), "{}", stderr(&bob));
    assert!(!home.file("bob.xtbid").exists() && stdout(&bob).contains("--identity bob`"), "{}", stdout(&bob));
    // A renewed certificate takes the place of the one before, and not the other way round.
    std::fs::copy(home.file("alice.xtbid"), home.file("old.xtbid")).unwrap();
    home.run("pki renew alice --force").code(0);
    home.run("enrol alice.xtbid").code(0);
    assert!(stderr(&home.run("enrol old.xtbid").code(1)).contains("has certificate 2 of alice already"));
    home.run("pki renew alice --force --days -1").code(0);
    let expired = stderr(&home.run("enrol alice.xtbid --to new").code(2));
    assert!(
        expired.contains("the certificate of alice expired on ") && !home.file("new").exists(),
        "{expired}"
    );
}

/// Nobody listens there.
const CLOSED: &str = "--timeout 0.2 --connect tls/127.0.0.1:1";

#[test]
fn fleet_name_and_router_follow_from_the_identity() {
    let home = Home::with_pki();
    home.run("pki add-person alice --role operator").code(0);
    home.run("enrol alice.xtbid").code(0);
    let no_router = stderr(&home.run(&format!("list {CLOSED}")).code(3));
    assert!(no_router.contains("tls/127.0.0.1:1"), "{no_router}");
    for (line, says) in [
        (
            "list --connect tcp/127.0.0.1:1",
            "tcp/127.0.0.1:1 has no TLS: the identity of alice is not used there",
        ),
        ("list --fleet hall", "fleet hall is asked for, but the identity of alice is of fleet lab"),
        ("list --client bob", "--client bob is not a name of alice"),
        ("list --identity nowhere", "cannot read the identity: nowhere/identity.toml"),
        (
            "list --identity none --connect tls/127.0.0.1:1",
            "tls/127.0.0.1:1 needs an identity, and there is none",
        ),
        ("sim --identity nowhere", "cannot read the identity"),
        ("sim --identities set --listen tcp/127.0.0.1:0", "tcp/127.0.0.1:0 has no TLS"),
        ("sim --identities set --connect tls/127.0.0.1:1", "--identities and --connect exclude each other"),
    ] {
        let said = stderr(&home.run(line).code(2));
        assert!(said.contains(says) && said.contains("hint: "), "{line}: {said}");
    }
    let without = stderr(&home.run("list --identity none --connect tcp/127.0.0.1:1 --timeout 0.2").code(3));
    assert!(without.contains("No router answers at tcp/127.0.0.1:1"), "{without}");
    let mut command = home.command("list --connect tcp/127.0.0.1:1 --timeout 0.2");
    command.env("XTB_IDENTITY", "").assert().code(3);
}

#[test]
fn an_identity_out_of_date_is_said_at_once() {
    let home = Home::with_pki();
    home.run("pki add-person alice --role operator").code(0);
    home.run("enrol alice.xtbid").code(0);
    // As time makes it: the folder's certificate is the expired one.
    home.run("pki renew alice --force --days -1").code(0);
    let enrolled =
        xtb_bus::Enrolled::write(&identity(&home.file("alice.xtbid")), &home.file(".config/xtb/identity"));
    enrolled.unwrap();
    let said = stderr(&home.run("list").code(2));
    assert!(said.contains("error: the certificate of alice expired on "), "{said}");
    assert!(said.contains("hint: `fleet-cli pki renew alice`"), "{said}");
    assert_eq!(json(&home.run("list --json").code(2))["error"]["code"], "config");
    home.run("pki renew alice --force --valid-from 2099-01-01T00:00:00Z").code(0);
    xtb_bus::Enrolled::write(&identity(&home.file("alice.xtbid")), &home.file(".config/xtb/identity"))
        .unwrap();
    let said = stderr(&home.run("list").code(2));
    assert!(said.contains("the certificate of alice is not valid before 2098-12-31T23:00:00Z"), "{said}");
    assert!(said.contains("hint: this computer's clock says "), "{said}");
    // What needs no fleet does not ask.
    home.run("completions bash").code(0);
    home.run("pki list").code(0);
}

#[test]
fn a_simulator_that_others_can_reach_needs_identities_or_a_word() {
    let home = Home::empty();
    for verb in ["sim --robots 1", "demo --headless --robots 1"] {
        let said = stderr(&home.run(&format!("{verb} --listen tcp/0.0.0.0:0")).code(2));
        assert!(said.contains("could drive every robot") && said.contains("--insecure"), "{said}");
    }
}
