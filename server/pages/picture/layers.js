/** What a picture is the sum of, and what else is known of its pixels, as they are asked for and shown. */
import { colourValues } from "./colours.js";
import { develop } from "./develop.js";

/** @type {[name: string, title: string][]} */
export const LAYERS = [
	["color", "All light"], ["sun_direct", "Sun's disc"], ["order0", "Forward peak"], ["order1", "Scattered once"], ["order2", "Scattered twice"],
	["multiple", "Three times and more"], ["cloud_sky", "Skylight by the clouds"], ["cloud_ground", "Ground's light by the clouds"], ["sky", "Sky behind"],
	["ground", "Ground"], ["air", "Air before it"], ["transmittance", "Transmittance"], ["optical_thickness", "Optical thickness"], ["distance", "Distance"],
];

const PREFIX = { color: "" };

/** @param {{channels: Map<string, Float32Array>}} exr  @param {string} layer */
export function planesOf(exr, layer) {
	const prefix = PREFIX[layer] ?? `${layer}.`;
	return ["R", "G", "B"].map((c) => exr.channels.get(prefix + c));
}

function rangeOf(values) {
	let low = Infinity;
	let high = 0;
	for (const value of values) {
		if (value > 0 && value < low)
			low = value;
		if (value > high && Number.isFinite(value))
			high = value;
	}
	return { low: Math.min(low, high), high };
}

function showScale(values, logarithmic, unit, codes) {
	const { low, high } = rangeOf(values);
	const from = logarithmic ? low : 0;
	const span = logarithmic ? Math.log(high / low) || 1 : high || 1;
	colourValues(values, (v) => (!(v > 0) ? (logarithmic ? NaN : 0) : logarithmic ? Math.log(v / low) / span : v / span), codes);
	return { from, to: high, unit, logarithmic };
}

/**
 * A layer of a file as codes.
 * @returns {{from: number, to: number, unit: string, logarithmic: boolean} | null} the scale of its colours, where they are one
 */
export function showLayer(exr, layer, ev, tone, codes) {
	if (layer === "optical_thickness")
		return showScale(exr.channels.get("optical_thickness.Y"), false, "", codes);
	if (layer === "distance")
		return showScale(exr.channels.get("distance.Z"), true, "m", codes);
	if (layer === "transmittance")
		develop(planesOf(exr, layer), exr.width, 0, "linear", codes);
	else
		develop(planesOf(exr, layer), exr.width, ev, tone, codes);
	return null;
}
