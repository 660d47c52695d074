/**
 * The members of a scene that the page has controls for. Ranges and defaults are those of openapi.yaml, which the tests hold them against.
 *
 * @typedef {object} Field
 * @property {string} path      member by its dotted name; an element of a list by its index behind that
 * @property {string} label
 * @property {string} [unit]
 * @property {number} [min]
 * @property {number} [max]
 * @property {number} [low]     where the slider begins, when that is above min; the number beside it reaches all of the range
 * @property {number} [high]    where it ends
 * @property {number} [step]    of the number
 * @property {boolean} [log]    the slider is logarithmic
 * @property {[string, string][]} [choices]  value and what people read
 * @property {any} initial
 * @property {string} [hint]
 */

/** @type {Field[]} */
const LIST = [
	{ path: "sun.elevation_deg", label: "Elevation", unit: "°", min: -18, max: 90, step: 0.1, initial: 35 },
	{ path: "sun.azimuth_deg", label: "Azimuth", unit: "°", min: 0, max: 360, step: 0.1, initial: 140 },
	{ path: "sun.latitude_deg", label: "Latitude", unit: "° N", min: -90, max: 90, step: 0.01, initial: 45.19 },
	{ path: "sun.longitude_deg", label: "Longitude", unit: "° E", min: -180, max: 180, step: 0.01, initial: 5.72 },

	{ path: "dsd.effective_radius_um", label: "Effective radius", unit: "µm", min: 1, max: 30, step: 0.1, log: true, initial: 7 },
	{ path: "dsd.gamma", label: "Narrowness γ", min: 1, max: 20, step: 0.1, log: true, initial: 2, hint: "High: droplets of one size, and a clear glory." },
	{ path: "dsd.n0_per_cm3", label: "Droplets", unit: "/cm³", min: 1, max: 5000, step: 1, log: true, initial: 300 },

	{
		path: "clouds.type", label: "Kind", initial: "stratocumulus",
		choices: [["stratus", "Stratus"], ["stratocumulus", "Stratocumulus"], ["altocumulus", "Altocumulus"], ["cirrocumulus", "Cirrocumulus"], ["none", "None"]],
	},
	{ path: "clouds.coverage", label: "Coverage", min: 0, max: 1, step: 0.01, initial: 0.7 },
	{ path: "clouds.base_m", label: "Base", unit: "m", min: 100, max: 12000, step: 10, log: true, initial: 1200 },
	{ path: "clouds.thickness_m", label: "Thickness", unit: "m", min: 0, max: 2000, high: 1200, step: 5, initial: 400, hint: "Of the thickest part." },
	{ path: "clouds.seed", label: "Seed", min: 0, max: 4294967295, high: 100, step: 1, initial: 1 },
	{ path: "clouds.time_s", label: "Time", unit: "s", min: 0, max: 10000000, high: 7200, step: 1, initial: 0 },
	{ path: "clouds.wind_mps.0", label: "Wind to the east", unit: "m/s", min: -100, max: 100, low: -40, high: 40, step: 0.5, initial: 8 },
	{ path: "clouds.wind_mps.1", label: "Wind to the north", unit: "m/s", min: -100, max: 100, low: -40, high: 40, step: 0.5, initial: 3 },

	{
		path: "ground.type", label: "Kind", initial: "country",
		choices: [["grass", "Grass"], ["country", "Open country"], ["soil", "Soil"], ["sand", "Sand"], ["sea", "Sea"], ["sea_ice", "Sea ice"], ["snow", "Snow"],
			["black", "Black"], ["lambert", "Any colour"]],
	},
	{ path: "ground.albedo.0", label: "Red albedo", min: 0, max: 1, step: 0.01, initial: 0.5 },
	{ path: "ground.albedo.1", label: "Green albedo", min: 0, max: 1, step: 0.01, initial: 0.5 },
	{ path: "ground.albedo.2", label: "Blue albedo", min: 0, max: 1, step: 0.01, initial: 0.5 },
	{ path: "ground.albedo_scale", label: "Albedo scale", min: 0, max: 2, step: 0.01, initial: 1 },
	{ path: "atmosphere.aerosol_optical_depth", label: "Haze", min: 0, max: 2, high: 1, step: 0.01, initial: 0.1, hint: "Optical depth of aerosol at 550 nm." },
	{ path: "atmosphere.ozone_du", label: "Ozone", unit: "DU", min: 0, max: 600, step: 5, initial: 300 },
	{ path: "radiosity.enabled", label: "Light between ground and clouds", initial: true },
	{
		path: "model.shading", label: "Clouds by", initial: "solved",
		choices: [["solved", "All orders, solved"], ["paper", "Bouthors et al. 2006"]],
	},
	{ path: "model.optics", label: "Droplets by", initial: "mie", choices: [["mie", "Mie theory"], ["paper", "The paper's table"]] },

	{ path: "camera.azimuth_deg", label: "Azimuth", unit: "°", min: 0, max: 360, step: 0.1, initial: 140 },
	{ path: "camera.elevation_deg", label: "Elevation", unit: "°", min: -90, max: 90, step: 0.1, initial: 20 },
	{ path: "camera.vertical_fov_deg", label: "Field of view", unit: "°", min: 0.5, max: 150, low: 5, high: 120, step: 0.5, initial: 60 },
	{ path: "camera.roll_deg", label: "Roll", unit: "°", min: -180, max: 180, step: 0.5, initial: 0 },
	{ path: "camera.position_m.2", label: "Height", unit: "m", min: 0.1, max: 30000, low: 1, step: 0.1, log: true, initial: 2 },
	{ path: "camera.position_m.0", label: "East", unit: "m", min: -1000000, max: 1000000, low: -10000, high: 10000, step: 10, initial: 0 },
	{ path: "camera.position_m.1", label: "North", unit: "m", min: -1000000, max: 1000000, low: -10000, high: 10000, step: 10, initial: 0 },
	{
		path: "camera.projection", label: "Projection", initial: "perspective",
		choices: [["perspective", "Perspective"], ["fisheye", "Fisheye, whole sky"], ["equirectangular", "Panorama, whole sphere"], ["cubemap", "Cube map"]],
	},

	{ path: "output.width", label: "Width", unit: "px", min: 16, max: 8192, low: 320, high: 4096, step: 1, initial: 1280 },
	{ path: "output.height", label: "Height", unit: "px", min: 16, max: 8192, low: 200, high: 4096, step: 1, initial: 800 },
	{ path: "output.exposure_ev", label: "Exposure", unit: "EV", min: -20, max: 20, low: -10, high: 16, step: 0.1, initial: "auto" },
	{ path: "output.tone", label: "Tone", initial: "filmic", choices: [["filmic", "Film"], ["linear", "Linear"]] },
];

/** @type {Map<string, Field>} */
export const FIELDS = new Map(LIST.map((field) => [field.path, field]));

/** What the page asks for where the service would choose otherwise. */
export const PAGE_DEFAULTS = { "output.width": 1280, "output.height": 800 };
