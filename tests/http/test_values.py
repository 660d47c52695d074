"""What the calls that answer numbers say."""
import math

import numpy
import pytest

from conftest import measures


def test_phase_functions_integrate_to_the_sphere(daemon):
    for query in ("", "?dsd.gamma=12&dsd.effective_radius_um=10"):
        optics = daemon.get("/v1/optics" + query).json
        angle = numpy.radians(optics["phase_function"]["angle_deg"])
        assert angle[0] == 0 and math.isclose(angle[-1], math.pi, abs_tol=1e-8)
        assert numpy.all(numpy.diff(angle) > 0)
        near = numpy.degrees(angle)
        assert numpy.diff(near[near <= 5]).max() <= 0.1 and numpy.diff(near[near >= 175]).max() <= 0.1
        for band, value in enumerate(numpy.array(optics["phase_function"]["value"])):
            assert numpy.all(value > 0)
            mu = numpy.cos(angle)
            integral = 2 * math.pi * numpy.trapz(value[::-1], mu[::-1])
            assert math.isclose(integral, 4 * math.pi, rel_tol=0.01)
            asymmetry = numpy.trapz((value * mu)[::-1], mu[::-1]) / 2
            assert math.isclose(asymmetry, optics["asymmetry"][band], rel_tol=0.01)


def test_optics_members(daemon):
    answer = daemon.get("/v1/optics")
    optics = answer.json
    assert set(optics) == {
        "wavelength_nm",
        "extinction_per_m",
        "asymmetry",
        "single_scattering_albedo",
        "forward_peak_fraction",
        "phase_function",
        "paper_fit",
    }
    assert optics["wavelength_nm"] == [650, 550, 450]
    assert all(0.8 < g < 0.9 for g in optics["asymmetry"])
    assert all(0.3 < p < 0.6 for p in optics["forward_peak_fraction"])
    assert optics["single_scattering_albedo"] == [1, 1, 1]
    assert set(optics["paper_fit"]) == {"beta", "sun_zenith_deg", "b", "c", "kappa_c", "t", "r"}
    assert "optics" in answer.timing


def test_extinction_is_proportional_to_droplets(daemon):
    one = daemon.get("/v1/optics?dsd.n0_per_cm3=100").json["extinction_per_m"]
    three = daemon.get("/v1/optics?dsd.n0_per_cm3=300").json["extinction_per_m"]
    assert numpy.allclose(numpy.array(three), 3 * numpy.array(one), rtol=1e-6)


def test_zenith_of_the_fit(daemon):
    assert daemon.get("/v1/optics").json["paper_fit"]["sun_zenith_deg"] == 55
    assert daemon.get("/v1/optics?sun_zenith_deg=20").json["paper_fit"]["sun_zenith_deg"] == 20
    assert daemon.get("/v1/optics?sun.elevation_deg=70").json["paper_fit"]["sun_zenith_deg"] == 20
    assert daemon.get("/v1/optics?sun_zenith_deg=91").pointers == {"/sun_zenith_deg"}
    assert daemon.get("/v1/optics?sun_zenith_deg=20&sun.elevation_deg=70").pointers == {"/sun_zenith_deg"}
    assert daemon.get("/v1/optics?sun.elevation_deg=-5").pointers == {"/sun"}
    assert daemon.get("/v1/optics?clouds.seed=5&dsd.gamma=0").pointers == {"/clouds/seed", "/dsd/gamma"}


@measures
@pytest.mark.parametrize("droplets", ["dsd.gamma=2", "dsd.gamma=9&dsd.effective_radius_um=12&dsd.n0_per_cm3=80", "model.optics=paper"])
@pytest.mark.parametrize("zenith", [0, 37, 60])
def test_fit_describes_a_slab_of_these_droplets(daemon, droplets, zenith):
    """Appendix A of the paper with the answer's own numbers, lengths in metres, against the solver."""
    fit = daemon.get(f"/v1/optics?{droplets}&sun_zenith_deg={zenith}").json["paper_fit"]
    assert fit["sun_zenith_deg"] == zenith
    for metres in (5, 30, 150, 800):
        solved = daemon.get(f"/v1/slab?{droplets}&sun_zenith_deg={zenith}&thickness_m={metres}&orders=modified").json
        b, c, beta, depth = fit["b"], fit["c"], fit["beta"], fit["kappa_c"] * metres
        total = (b + (1 - b) * math.exp(-c * metres)) * beta / (metres - (metres - 1) * beta)
        assert math.isclose(total, 1 - solved["reflectance"][1], abs_tol=0.015)
        once = {"t1": fit["t"] * depth * math.exp(-depth), "r1": fit["r"] / 2 * (1 - math.exp(-2 * depth))}
        for name, value in once.items():
            assert math.isclose(value, solved["orders"][name][1], abs_tol=0.025), name


def test_lengths_of_the_fit_go_with_the_droplets(daemon):
    one, four = (daemon.get(f"/v1/optics?dsd.n0_per_cm3={n0}").json["paper_fit"] for n0 in (100, 400))
    for name in ("c", "kappa_c"):
        assert math.isclose(four[name], 4 * one[name], rel_tol=0.02)
    for name in ("b", "t", "r"):
        assert math.isclose(four[name], one[name], rel_tol=0.02)


def test_sun(daemon):
    """The worked example of NREL/TP-560-34302."""
    sun = daemon.get("/v1/sun?time=2003-10-17T12:30:30-07:00&latitude_deg=39.742476&longitude_deg=-105.1786").json
    assert math.isclose(sun["elevation_deg"], 39.872, abs_tol=0.003)
    assert math.isclose(sun["azimuth_deg"], 194.340, abs_tol=0.003)
    midnight = daemon.get("/v1/sun?time=2024-12-21T00:00:00Z&latitude_deg=51.5&longitude_deg=0").json
    assert midnight["elevation_deg"] < -60


@pytest.mark.parametrize(
    "query, pointers",
    [
        ("", {"/time", "/latitude_deg", "/longitude_deg"}),
        ("time=now&latitude_deg=91&longitude_deg=x", {"/time", "/latitude_deg", "/longitude_deg"}),
        ("time=2024-01-01T00:00:00Z&latitude_deg=0&longitude_deg=0&height=3", {"/height"}),
        ("time=2024-01-01T00:00:00Z&latitude_deg=0&longitude_deg=0&latitude_deg=0", {"/latitude_deg"}),
    ],
)
def test_sun_refusals(daemon, query, pointers):
    answer = daemon.get("/v1/sun?" + query)
    assert answer.status == 422
    assert answer.pointers == pointers
