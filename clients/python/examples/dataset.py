#!/usr/bin/env python3
"""A data set of skies: random suns and droplets, clouds and ground, as images and labels.

    PYTHONPATH=clients/python python3 clients/python/examples/dataset.py -n 100 -o skies

writes skies/images.npy (uint8, [n][height][width][3]) and skies/labels.csv, whose rows are the images.
"""
import argparse
import csv
import pathlib

import numpy

import stratus

LABELS = ("sun.elevation_deg", "sun.azimuth_deg", "dsd.effective_radius_um", "dsd.gamma", "clouds.coverage", "clouds.thickness_m", "clouds.seed", "clouds.type")
TYPES = ("stratus", "stratocumulus", "altocumulus")


def draw(random):
    """One scene. Ranges are narrower than what the daemon takes (stratus.limits): the sun is up, droplets are those of clouds."""
    scene = stratus.Scene(output=stratus.Output(width=256, height=192))
    scene.set("sun.elevation_deg", random.uniform(2, 70)).set("sun.azimuth_deg", random.uniform(0, 360))
    scene.set("dsd.effective_radius_um", random.uniform(4, 20)).set("dsd.gamma", random.uniform(2, 12)).set("dsd.n0_per_cm3", 100)
    scene.set("clouds.coverage", random.uniform(0.2, 0.9)).set("clouds.thickness_m", random.uniform(100, 600))
    scene.set("clouds.seed", int(random.integers(2**32))).set("clouds.type", str(random.choice(TYPES)))
    scene.set("camera.azimuth_deg", random.uniform(0, 360))
    return scene


def label(scene, path):
    section, name = path.split(".")
    return getattr(getattr(scene, section), name)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-n", type=int, default=100, help="how many")
    parser.add_argument("-o", type=pathlib.Path, default=pathlib.Path("skies"), help="folder")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--at-once", type=int, default=4)
    arguments = parser.parse_args()

    random = numpy.random.default_rng(arguments.seed)
    scenes = [draw(random) for _ in range(arguments.n)]
    arguments.o.mkdir(parents=True, exist_ok=True)
    images = numpy.lib.format.open_memmap(arguments.o / "images.npy", "w+", numpy.uint8, (arguments.n, 192, 256, 3))
    with open(arguments.o / "labels.csv", "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(LABELS)
        for index, picture in enumerate(stratus.Client().render_many(scenes, at_once=arguments.at_once)):
            images[index] = picture.array
            table.writerow([label(scenes[index], path) for path in LABELS])
            print(f"\r{index + 1}/{arguments.n}", end="", flush=True)
    images.flush()
    print(f"\r{arguments.n} images and labels in {arguments.o}")


if __name__ == "__main__":
    main()
