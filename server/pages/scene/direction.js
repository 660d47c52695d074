/** Which way the places of a picture look. Azimuth clockwise from north, elevation from the horizon, degrees. */

const rad = Math.PI / 180;

/** Of a perspective picture: u from -1 at its left edge to 1, v from -1 at its lower edge to 1. */
function perspective(scene, u, v) {
	const [azimuth, elevation, roll] = ["azimuth", "elevation", "roll"].map((name) => scene.value(`camera.${name}_deg`) * rad);
	const half = Math.tan((scene.value("camera.vertical_fov_deg") / 2) * rad);
	const [ca, sa, ce, se] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(elevation), Math.sin(elevation)];
	const [x, y] = [u * half * scene.shape, v * half];
	/* A picture that is turned clockwise was taken by a camera turned the other way. */
	const [right, up] = [x * Math.cos(roll) - y * Math.sin(roll), y * Math.cos(roll) + x * Math.sin(roll)];
	const [east, north, high] = [sa * ce + right * ca - up * sa * se, ca * ce - right * sa - up * ca * se, se + up * ce];
	return { azimuth: (Math.atan2(east, north) / rad + 360) % 360, elevation: Math.atan2(high, Math.hypot(east, north)) / rad };
}

/**
 * @param {import("./scene.js").Scene} scene
 * @returns {{azimuth: number, elevation: number} | null} null where the picture shows nothing, and for cube maps
 */
export function directionAt(scene, u, v) {
	switch (scene.value("camera.projection")) {
		case "perspective":
			return perspective(scene, u, v);
		case "fisheye":
			return Math.hypot(u, v) > 1 ? null : { azimuth: (Math.atan2(-u, v) / rad + 360) % 360, elevation: 90 * (1 - Math.hypot(u, v)) };
		case "equirectangular":
			return { azimuth: 180 * (u + 1), elevation: 90 * v };
		default:
			return null;
	}
}

/** Degrees between two directions. */
export function between(a, b) {
	const cosine = Math.sin(a.elevation * rad) * Math.sin(b.elevation * rad) + Math.cos(a.elevation * rad) * Math.cos(b.elevation * rad) * Math.cos((a.azimuth - b.azimuth) * rad);
	return Math.acos(Math.min(Math.max(cosine, -1), 1)) / rad;
}
