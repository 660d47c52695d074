/** Texts that a PNG carries before its pixels (iTXt, not compressed). */

const HEAD = 64 * 1024;

/** @param {Blob} blob  @param {string} keyword  @returns {Promise<string | null>} */
export async function readPngText(blob, keyword) {
	const view = new DataView(await blob.slice(0, HEAD).arrayBuffer());
	const decode = (from, to) => new TextDecoder().decode(view.buffer.slice(from, to));
	for (let at = 8; at + 12 <= view.byteLength; ) {
		const size = view.getUint32(at);
		const type = decode(at + 4, at + 8);
		if (type === "IDAT")
			return null;
		const [name, rest] = type === "iTXt" ? splitOnce(decode(at + 8, at + 8 + size), "\0") : [];
		/* Behind the keyword: compression flag and method, language, translated keyword. */
		if (name === keyword)
			return rest.slice(2).split("\0").slice(2).join("\0");
		at += 12 + size;
	}
	return null;
}

function splitOnce(text, by) {
	const at = text.indexOf(by);
	return [text.slice(0, at), text.slice(at + by.length)];
}
