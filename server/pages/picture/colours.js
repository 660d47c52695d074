/** Colours for numbers: a fit of six orders to matplotlib's viridis by Matt Zucker (CC0, https://www.shadertoy.com/view/WlfXRN). */
const VIRIDIS = [
	[0.2777273272234177, 0.005407344544966578, 0.3340998053353061],
	[0.1050930431085774, 1.404613529898575, 1.384590162594685],
	[-0.3308618287255563, 0.214847559468213, 0.09509516302823659],
	[-4.634230498983486, -5.799100973351585, -19.33244095627987],
	[6.228269936347081, 14.17993336680509, 56.69055260068105],
	[4.776384997670288, -13.74514537774601, -65.35303263337234],
	[-5.435455855934631, 4.645852612178535, 26.3124352495832],
];

/** @param {number} t from 0 to 1  @returns {number[]} red, green, blue as codes of 8 bits */
export function viridis(t) {
	const x = Math.min(Math.max(t, 0), 1);
	return [0, 1, 2].map((c) => 255 * Math.min(Math.max(VIRIDIS.reduceRight((sum, term) => sum * x + term[c], 0), 0), 1));
}

/** 256 of them in a row. */
const TABLE = new Uint8ClampedArray(Array.from({ length: 256 }, (_, i) => viridis(i / 255)).flat());

/**
 * @param {Float32Array} values
 * @param {(value: number) => number} place from 0 to 1; NaN is shown as nothing
 * @param {Uint8ClampedArray} codes
 */
export function colourValues(values, place, codes) {
	for (let i = 0; i < values.length; i++) {
		const t = place(values[i]);
		const at = 3 * Math.round(255 * Math.min(Math.max(t, 0), 1));
		for (let c = 0; c < 3; c++)
			codes[4 * i + c] = Number.isNaN(t) ? 24 : TABLE[at + c];
		codes[4 * i + 3] = 255;
	}
}
