//! Silly values of every argument: each is refused by its own name, with what it was and what would be accepted.

use crate::desk::Desk;

#[test]
fn a_silly_value_is_refused_with_its_argument_and_what_is_accepted() {
    let (desk, paint) = (Desk::new(), "sample:bmw339");
    let (blend, draw) = (
        ["blend", paint, paint, "--out", "x"],
        ["preview", paint, "--out", "x.png"],
    );
    let ingest = ["ingest", "x.zip", "--out", "x"];
    let numbers: &[(&[&str], &str, &str)] = &[
        (&blend, "--max-error", "a number above 0"),
        (&blend, "--max-seconds", "a number above 0"),
        (&blend, "--clusters", "1 to 4096"),
        (&draw, "--spp", "1 to 4096"),
        (&draw, "--size", "1 to 16384 each"),
        (&draw, "--weights", "finite numbers separated by commas"),
        (&draw, "--base", "finite numbers separated by commas"),
        (&draw, "--flake-saturation", "a finite number"),
        (
            &["texels", paint, "--theta-h", "0", "--out", "x.exr"],
            "--theta-d",
            "0 to 90",
        ),
        (
            &["texels", paint, "--theta-d", "0", "--out", "x.exr"],
            "--theta-h",
            "0 to 90",
        ),
        (
            &[
                "texels",
                paint,
                "--theta-h",
                "0",
                "--theta-d",
                "0",
                "--out",
                "x.exr",
            ],
            "--seed",
            "0 to 4294967295",
        ),
        (&ingest, "--header-bytes", "0 to 1048576"),
        (&ingest, "--coat-ior", "1 to 4"),
        (&["samples", "list"], "--threads", "1 to 1024"),
        (&["serve"], "--listen", "an IP address and a port"),
        (
            &ingest,
            "--layout",
            "mpi-2005, merl, rgl, package, csv, cxf",
        ),
        (&ingest, "--theta-h", "linear, sqrt"),
        (
            &["estimate", "realise", paint],
            "--format",
            "zip, glb, json, paint",
        ),
    ];
    for (command, argument, accepted) in numbers {
        for value in ["nan", "inf", "-inf", "1e99", "word", "-1x", ""] {
            if (*argument, value) == ("--max-error", "1e99")
                || (*argument, value) == ("--max-seconds", "1e99")
                || (["--weights", "--base", "--flake-saturation"].contains(argument)
                    && value == "1e99")
            {
                continue;
            }
            let said = desk.refused(2, &[*command, &[*argument, value]].concat());
            assert!(
                said.contains(argument) && said.contains(value) && said.contains(accepted),
                "{argument} {value}: {said}"
            );
        }
    }
    assert!(desk.files().is_empty());
}

#[test]
fn a_number_below_zero_is_a_value_and_not_another_argument() {
    let (desk, paint) = (Desk::new(), "sample:bmw339");
    for (argument, value) in [
        ("--max-error", "-1"),
        ("--max-seconds", "-2"),
        ("--clusters", "-3"),
    ] {
        let said = desk.refused(2, &["blend", paint, paint, "--out", "x", argument, value]);
        assert!(
            said.contains(argument) && said.contains(value) && said.contains("accepted is"),
            "{said}"
        );
    }
    assert!(desk.files().is_empty());
}

#[test]
fn a_silly_knob_is_refused_with_its_name_and_range_wherever_it_stands() {
    let desk = Desk::new();
    for (knob, told) in [
        (
            "clusters=99999999999",
            "clusters is 99999999999, accepted is a whole number from 1 to 4096",
        ),
        (
            "clusters=nan",
            "clusters is \"nan\", accepted is a whole number from 1 to 4096",
        ),
        (
            "angle_step=-1",
            "angle_step is -1, accepted is a whole number from 1 to 16",
        ),
        (
            "samples_per_pixel=1e99",
            "samples_per_pixel is 1e+99, accepted is a whole number from 1 to 4096",
        ),
        (
            "transport=sinkhorn,epsilon=inf",
            "epsilon is \"inf\", accepted is 1e-6 to 10",
        ),
        ("cost=3", "cost is 3, accepted is distance or squared"),
        (
            "order=",
            "order is \"\", accepted is canonical, sampled or cheapest",
        ),
        (
            "draw=dice",
            "draw is \"dice\", accepted is alias, inverse_cdf or both",
        ),
    ] {
        for argument in ["--knob", "--profile"] {
            let said = desk.refused(2, &["show", "sample:blue", argument, knob]);
            assert!(said.contains(told), "{argument} {knob}: {said}");
        }
    }
}

#[test]
fn a_target_is_taken_only_where_something_is_picked_for_it() {
    let desk = Desk::new();
    for command in ["show", "selftest"] {
        let said = desk.refused(2, &[command, "sample:blue", "--max-error", "1"]);
        assert!(said.contains("unexpected argument '--max-error'"), "{said}");
    }
}
