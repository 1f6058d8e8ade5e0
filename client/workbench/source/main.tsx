import { render } from "preact";
import { App, LiveApp } from "./app";
import { startLive } from "./data/live";
import { FileSource, isLive } from "./data/load";
import { followPrint } from "./print";
import { followHash, page } from "./state";
import "./style.css";
import "./print.css";

const place = document.getElementById("page")!;

async function start(): Promise<void> {
  followPrint();
  if (isLive()) {
    document.title = "Touchstone workbench";
    place.replaceChildren();
    render(<LiveApp />, place);
    await startLive();
    return;
  }
  try {
    page.value = await new FileSource().load();
  } catch (reason) {
    place.replaceChildren();
    render(<main><h1>This report cannot be read</h1><p role="alert">{reason instanceof Error ? reason.message : String(reason)}</p><p>Make it anew: touchstone diagnose --html FILE.</p></main>, place);
    return;
  }
  const name = page.value.report.model_name;
  document.title = name ? `Touchstone report: ${name}` : "Touchstone report";
  followHash();
  place.replaceChildren();
  render(<App />, place);
}

void start();
