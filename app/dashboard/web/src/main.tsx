import "./base.css";
import "./print.css";
import "./ui/parts/common.css";
import { effect } from "@preact/signals";
import { render } from "preact";
import { findCharts } from "./state/device/baseMap";
import { startSession } from "./state/session";
import { isDark, printing, theme } from "./state/store";
import { askBeforeLeaving } from "./state/uploads";
import { App } from "./ui/App";

effect(() => {
  const { value } = theme;
  const own = !printing.value && (value === "contrast" || value === "night") ? value : null;
  document.documentElement.dataset.theme = own ?? (isDark.value ? "dark" : "light");
});
startSession();
askBeforeLeaving();
void findCharts();
render(<App />, document.getElementById("app") as HTMLElement);
