import "./base.css";
import "./print.css";
import "./ui/parts/common.css";
import { effect } from "@preact/signals";
import { render } from "preact";
import { findCharts } from "./state/device/baseMap";
import { startSession } from "./state/session";
import { isDark, theme } from "./state/store";
import { askBeforeLeaving } from "./state/uploads";
import { App } from "./ui/App";

effect(() => {
  const { value } = theme;
  document.documentElement.dataset.theme =
    value === "contrast" || value === "night" ? value : isDark.value ? "dark" : "light";
});
startSession();
askBeforeLeaving();
void findCharts();
render(<App />, document.getElementById("app") as HTMLElement);
