/** Dark or light: as the system says, or as was chosen here. */
const KEPT = "stratus-theme";

export function followTheme(button) {
	const system = matchMedia("(prefers-color-scheme: dark)");
	const current = () => localStorage.getItem(KEPT) ?? (system.matches ? "dark" : "light");
	const show = () => {
		document.documentElement.dataset.theme = current();
		button.setAttribute("aria-label", current() === "dark" ? "Light colours" : "Dark colours");
	};
	button.addEventListener("click", () => {
		localStorage.setItem(KEPT, current() === "dark" ? "light" : "dark");
		show();
	});
	system.addEventListener("change", show);
	show();
}
