/** Reads the uncompressed OpenEXR files of one part that the page asks for: scan lines of half, float or uint channels. */

const MAGIC = 0x01312f76;
const BYTES = [4, 2, 4];
const decoder = new TextDecoder();

/** Floats of all 65536 halves. */
const HALVES = new Float32Array(65536).map((_, bits) => {
	const sign = bits & 0x8000 ? -1 : 1;
	const exponent = (bits >> 10) & 31;
	const mantissa = bits & 1023;
	if (exponent === 0)
		return sign * mantissa * 2 ** -24;
	if (exponent === 31)
		return mantissa ? NaN : sign * Infinity;
	return sign * (1 + mantissa / 1024) * 2 ** (exponent - 15);
});

class Reader {
	/** @param {ArrayBuffer} buffer */
	constructor(buffer) {
		this.bytes = new Uint8Array(buffer);
		this.view = new DataView(buffer);
		this.at = 0;
	}

	int() {
		this.at += 4;
		return this.view.getInt32(this.at - 4, true);
	}

	byte() {
		return this.bytes[this.at++];
	}

	text() {
		const end = this.bytes.indexOf(0, this.at);
		const text = decoder.decode(this.bytes.subarray(this.at, end));
		this.at = end + 1;
		return text;
	}
}

function readChannels(reader, end) {
	const channels = [];
	while (reader.at < end - 1) {
		const name = reader.text();
		channels.push({ name, type: reader.int() });
		reader.at += 12;
	}
	return channels;
}

/** @returns {Record<string, any>} the attributes that pictures are read by, and those of the service that are numbers */
function readHeader(reader) {
	const header = {};
	for (let name = reader.text(); name; name = reader.text()) {
		const type = reader.text();
		const size = reader.int();
		const next = reader.at + size;
		if (type === "chlist")
			header.channels = readChannels(reader, next);
		else if (type === "compression")
			header.compression = reader.byte();
		else if (type === "box2i" && name === "dataWindow")
			header.window = [reader.int(), reader.int(), reader.int(), reader.int()];
		else if (type === "float" || type === "double")
			header[name] = type === "float" ? reader.view.getFloat32(reader.at, true) : reader.view.getFloat64(reader.at, true);
		reader.at = next;
	}
	return header;
}

function readLine(view, at, type, line) {
	for (let x = 0; x < line.length; x++)
		line[x] = type === 1 ? HALVES[view.getUint16(at + 2 * x, true)] : type === 2 ? view.getFloat32(at + 4 * x, true) : view.getUint32(at + 4 * x, true);
}

/**
 * @param {ArrayBuffer} buffer
 * @returns {{width: number, height: number, header: Record<string, any>, channels: Map<string, Float32Array>}} rows from the top
 */
export function readExr(buffer) {
	const reader = new Reader(buffer);
	if (reader.int() !== MAGIC || (reader.int() & 0x1e00) !== 0)
		throw new Error("That is no OpenEXR file of one part with scan lines.");
	const header = readHeader(reader);
	if (header.compression !== 0)
		throw new Error("That OpenEXR file is compressed.");
	const [left, top, right, bottom] = header.window;
	const width = right - left + 1;
	const height = bottom - top + 1;
	const channels = new Map(header.channels.map(({ name }) => [name, new Float32Array(width * height)]));
	reader.at += 8 * height;
	for (let row = 0; row < height; row++) {
		const y = reader.int() - top;
		reader.at += 4;
		for (const { name, type } of header.channels) {
			readLine(reader.view, reader.at, type, channels.get(name).subarray(y * width, (y + 1) * width));
			reader.at += width * BYTES[type];
		}
	}
	return { width, height, header, channels };
}
