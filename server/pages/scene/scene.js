import { FIELDS, PAGE_DEFAULTS } from "./fields.js";

/** Members that say where a camera with one picture looks; panoramas refuse them. */
const DIRECTION = ["azimuth_deg", "elevation_deg", "roll_deg", "vertical_fov_deg"];
/** Width over height of panoramas. */
const SHAPES = { fisheye: 1, equirectangular: 2, cubemap: 1 / 6 };
/** Lists by what they are when nothing is said. */
const LISTS = { "camera.position_m": [0, 0, 2], "clouds.wind_mps": [8, 3], "ground.albedo": [0.5, 0.5, 0.5] };

const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);

/** "clouds.wind_mps.1" as its section, member and index. */
function split(path) {
	const [section, name, index] = path.split(".");
	return { section, name, index: index === undefined ? -1 : Number(index) };
}

/**
 * What the page shows: a scene as /v1/render takes it, of which only what was said is kept.
 * Says "change" with {paths, moving} as its detail: which members, and whether more such are to be expected at once.
 */
export class Scene extends EventTarget {
	/** @type {Record<string, Record<string, any>>} */
	#said = {};

	constructor() {
		super();
		this.replace({});
	}

	/** A member's value, its default when it was not said. */
	value(path) {
		const { section, name, index } = split(path);
		const said = this.#said[section]?.[name];
		if (said === undefined)
			return index >= 0 ? LISTS[`${section}.${name}`][index] : FIELDS.get(path)?.initial;
		return index >= 0 ? said[index] : said;
	}

	/**
	 * @param {Record<string, any>} values by their paths; undefined takes one away
	 * @param {{moving?: boolean}} [how]
	 */
	set(values, { moving = false } = {}) {
		const changed = Object.keys(values).filter((path) => !same(this.value(path), values[path]));
		for (const path of changed)
			this.#put(path, values[path]);
		if (changed.length)
			this.dispatchEvent(new CustomEvent("change", { detail: { paths: new Set(changed), moving } }));
	}

	#put(path, value) {
		const { section, name, index } = split(path);
		const inner = (this.#said[section] ??= {});
		if (index >= 0) {
			inner[name] = [...(inner[name] ?? LISTS[`${section}.${name}`])];
			inner[name][index] = value;
		} else if (value === undefined) {
			delete inner[name];
		} else {
			inner[name] = value;
		}
	}

	/** Another scene altogether. */
	replace(members) {
		this.#said = structuredClone(members);
		const dsd = this.#said.dsd;
		if (dsd?.characteristic_radius_um !== undefined) {
			dsd.effective_radius_um = ((dsd.gamma ?? 2) + 2) * dsd.characteristic_radius_um;
			delete dsd.characteristic_radius_um;
		}
		const output = (this.#said.output ??= {});
		for (const name of ["format", "layers", "bits", "exr_type", "exr_compression", "png_compression"])
			delete output[name];
		for (const [path, value] of Object.entries(PAGE_DEFAULTS))
			output[split(path).name] ??= value;
		this.dispatchEvent(new CustomEvent("change", { detail: { paths: null, moving: false } }));
	}

	get isPanorama() {
		return this.value("camera.projection") !== "perspective";
	}

	get isByPlace() {
		return this.#said.sun?.time !== undefined;
	}

	/** Width over height. */
	get shape() {
		if (this.value("camera.face"))
			return 1;
		return SHAPES[this.value("camera.projection")] ?? this.value("output.width") / this.value("output.height");
	}

	/**
	 * The scene as JSON for /v1/render, without what is the service's default.
	 * @param {Record<string, any>} [output] laid over the members of output
	 */
	members(output = {}) {
		/** @type {Record<string, Record<string, any>>} */
		const members = structuredClone(this.#said);
		if (this.isPanorama)
			this.#trimPanorama(members);
		if (this.isByPlace) {
			members.sun = { time: members.sun.time, latitude_deg: this.value("sun.latitude_deg"), longitude_deg: this.value("sun.longitude_deg") };
		} else if (members.sun) {
			delete members.sun.latitude_deg;
			delete members.sun.longitude_deg;
		}
		if (this.value("ground.type") !== "lambert")
			delete members.ground?.albedo;
		members.output = { ...members.output, ...output };
		return prune(members, this.isByPlace);
	}

	#trimPanorama(members) {
		for (const name of DIRECTION)
			delete members.camera[name];
		if (members.output.width !== members.output.height * this.shape) {
			delete members.output.width;
			delete members.output.height;
		}
	}
}

/** Without members that say what holds anyway, and without empty sections. */
function prune(members, byPlace) {
	for (const [section, inner] of Object.entries(members)) {
		for (const [name, value] of Object.entries(inner)) {
			const path = `${section}.${name}`;
			const initial = LISTS[path] ?? FIELDS.get(path)?.initial;
			if (value === undefined || (same(value, initial) && !(path in PAGE_DEFAULTS) && !(byPlace && section === "sun")))
				delete inner[name];
		}
		if (!Object.keys(inner).length)
			delete members[section];
	}
	return members;
}
