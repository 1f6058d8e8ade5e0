// The look of the HTML report. Colours are chosen to be told apart with any colour vision (after Okabe and
// Ito): the given model is vermilion, the improved one blue, measurements are ink, residuals run from purple
// (early) over grey to orange (late).
#include "client/report/html_page.h"

namespace touchstone::client {

const char* HtmlStyle() {
  return R"css(
:root{color-scheme:light dark;--paper:#fff;--wash:#f4f5f7;--ink:#1c2127;--soft:#5a6470;--line:#dde1e6;
--given:#c8500a;--better:#0b6bb0;--measured:#4a525c;--area:#c9ced5;--good:#1a7f4b;--warn:#8a5a00;--warnwash:#fff6e0;
--f0:#b4548a;--f1:#00805d;--f2:#b97d00;--f3:#3d7fc4;--f4:#7a55c7;--f5:#6b7280;
--d0:#40237a;--d1:#7760b6;--d2:#aa9bd3;--d3:#a9aeb4;--d4:#eeaf5c;--d5:#d97a14;--d6:#9a4600;
--s0:#c6ccd3;--s1:#d3d8de;--s2:#dfe3e8;--s3:#e9ecf0;--s4:#f1f3f6}
@media (prefers-color-scheme:dark){:root{--paper:#14171b;--wash:#1d2126;--ink:#e7eaee;--soft:#9ba5b0;--line:#323940;
--given:#ff9a57;--better:#62b6f2;--measured:#c4ccd5;--area:#464e58;--good:#5fce97;--warn:#f0c264;--warnwash:#2c2616;
--f0:#e58fbd;--f1:#3fc79b;--f2:#e9b23f;--f3:#7fb5ee;--f4:#b39af0;--f5:#a3abb5;
--d0:#d6c8ff;--d1:#a48bf0;--d2:#7462b4;--d3:#6d757e;--d4:#b07a35;--d5:#f09a36;--d6:#ffd09a;
--s0:#22272d;--s1:#282e34;--s2:#2e343b;--s3:#343b43;--s4:#3a424a}}
*{box-sizing:border-box}
html{-webkit-text-size-adjust:100%}
body{margin:0;background:var(--paper);color:var(--ink);font:16px/1.55 system-ui,-apple-system,"Segoe UI",Roboto,
"Helvetica Neue",Arial,sans-serif;font-variant-numeric:tabular-nums}
main{max-width:66rem;margin:0 auto;padding:2.5rem 1.5rem 4rem}
h1{font-size:clamp(1.55rem,1.1rem + 2vw,2.25rem);line-height:1.2;letter-spacing:-.018em;font-weight:650;
margin:.6rem 0 .9rem;max-width:26em;text-wrap:balance}
h2{font-size:1.35rem;line-height:1.3;letter-spacing:-.01em;font-weight:650;margin:0 0 .3rem}
h3{font-size:1rem;line-height:1.4;font-weight:650;margin:2rem 0 .5rem}
section{margin-top:3.5rem;padding-top:1.5rem;border-top:1px solid var(--line)}
p{margin:0 0 .8rem;max-width:42em}
.kicker{display:flex;flex-wrap:wrap;gap:.35rem .8rem;align-items:center;color:var(--soft);font-size:.875rem;
margin:0;max-width:none}
.pill{border:1.5px solid currentColor;border-radius:99px;padding:.05rem .7rem;font-weight:600;color:var(--given)}
.pill.good{color:var(--good)}
.pill.plain{color:var(--soft)}
.lead{font-size:1.0625rem;max-width:40em;margin:1.6rem 0 -.4rem}
.about{color:var(--soft);margin-bottom:1.2rem}
.facts{margin:1.1rem 0 0;color:var(--soft);font-size:.9375rem;max-width:none}
figure{margin:1.25rem 0 0;min-width:0}
figcaption{color:var(--soft);font-size:.8125rem;line-height:1.45;margin-top:.45rem;max-width:48em}
.grid{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(19rem,100%),1fr));gap:1.25rem 2rem;
align-items:start}
.grid figure{margin:0}
.wide{grid-template-columns:repeat(auto-fit,minmax(min(28rem,100%),1fr))}
.note{color:var(--soft);font-size:.8125rem;line-height:1.45;margin-top:.7rem;max-width:48em}
.pair{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(13rem,100%),1fr));gap:.5rem 1rem}
.groups{grid-template-columns:repeat(auto-fill,minmax(min(22rem,100%),1fr));gap:1.5rem 3rem}
.groups td:first-child{overflow-wrap:anywhere}
.groups .barcell{min-width:3.5rem}
.head{font-weight:600;font-size:.9375rem;margin:0 0 .4rem}
.head span{font-weight:400;color:var(--soft)}
h4{font-size:.9375rem;font-weight:600;margin:1.4rem 0 .4rem}

.line-high{height:1.4em;display:flex;align-items:center}
.pictures{width:9rem;min-width:9rem}
svg.chart.interval{width:8.5rem;height:1rem}
.arrows{grid-template-columns:repeat(auto-fill,minmax(min(15rem,100%),1fr))}
.why .barcell{width:20%}
figure+p{margin-top:1.25rem}
.rest{margin-top:1rem;grid-template-columns:minmax(0,1fr) minmax(0,1fr);color:var(--soft);font-size:.875rem}
details{margin-top:1.25rem}summary{cursor:pointer;color:var(--soft);font-size:.9375rem;margin-bottom:1rem}
.why td>div{white-space:nowrap}
.hist{grid-template-columns:repeat(auto-fill,minmax(min(14rem,100%),1fr));gap:1.25rem 1.75rem}
.arrows .map{overflow:visible}
.arrows figcaption{text-align:center;margin-top:0}
.scroll{overflow-x:auto}
table{border-collapse:collapse;width:100%;font-size:.9375rem;line-height:1.4}
th{font-weight:500;color:var(--soft);font-size:.8125rem;text-align:left;vertical-align:bottom}
th,td{padding:.42rem .9rem .42rem 0;border-bottom:1px solid var(--line)}
td{vertical-align:top}
th:last-child,td:last-child{padding-right:0}
thead th{border-bottom-color:var(--soft)}
.num{text-align:right;white-space:nowrap;padding-right:1.4rem}
sup,sub{line-height:0;font-size:.75em}
.name{font-weight:600}
.dim,.dim td{color:var(--soft)}
.barcell{width:34%;min-width:7rem}.barcell.narrow{width:18%;min-width:5rem}
svg{display:block;max-width:100%}
svg.bar{width:100%;height:.9rem;margin-top:.2rem;overflow:visible}
.fill.given{fill:var(--given)}.fill.better{fill:var(--better)}.fill.floor{fill:var(--soft)}
.fill.suggested{fill:var(--better);opacity:.5}.fill.share{fill:var(--area)}
.mark{stroke:var(--ink);stroke-width:1.5;stroke-dasharray:3 2}
.ladder{font-size:1rem}
.ladder td{padding-top:.5rem;padding-bottom:.5rem}
.ladder .barcell{width:42%}.ladder .name{min-width:10rem}
.ladder svg.bar{height:1.25rem;margin-top:.1rem}
.ladder tr.last td{border-bottom-color:transparent}
.warnings{background:var(--warnwash);border-radius:.5rem;padding:.8rem 1.1rem;margin:1.5rem 0 0;font-size:.9375rem}
.warnings p{margin:0;font-weight:600;color:var(--warn)}
.warnings ul{margin:.2rem 0 0;padding-left:1.1rem}
ol.steps{list-style:none;margin:1rem 0 0;padding:0;display:grid;gap:1.75rem}
ol.steps>li{display:grid;grid-template-columns:2.1rem 1fr;gap:0 .9rem}
.count{width:2.1rem;height:2.1rem;border-radius:50%;background:var(--better);color:var(--paper);font-weight:650;
display:grid;place-items:center}
ol.steps>li>div{min-width:0}
ol.steps h3{margin:.15rem 0 .3rem;font-size:1.125rem}
ol.steps p{margin:0 0 .4rem}
ol.steps table{margin:.5rem 0 .7rem;width:auto;min-width:min(34rem,100%)}
dl{display:grid;grid-template-columns:max-content 1fr;gap:.3rem 1.1rem;margin:.4rem 0 0;font-size:.9375rem}
dt{color:var(--soft)}
dd{margin:0;max-width:42em;overflow-wrap:anywhere}
pre{background:var(--wash);border-radius:.5rem;padding:.9rem 1.1rem;overflow-x:auto;margin:.5rem 0 0;
font:.8438rem/1.5 ui-monospace,SFMono-Regular,Menlo,Consolas,monospace}
code{font:.92em ui-monospace,SFMono-Regular,Menlo,Consolas,monospace;overflow-wrap:anywhere}
button,select{font:inherit;font-size:.875rem;color:var(--ink);background:var(--paper);border:1px solid var(--line);
border-radius:.4rem;padding:.28rem .75rem;cursor:pointer}
button:hover{border-color:var(--soft)}
button[aria-pressed=true]{background:var(--ink);color:var(--paper);border-color:var(--ink)}
:focus-visible{outline:2px solid var(--better);outline-offset:2px}
.row{display:flex;flex-wrap:wrap;gap:.5rem 1.25rem;align-items:center;margin:.5rem 0}
.row>span,.row>label{display:inline-flex;gap:.35rem;align-items:center;font-size:.875rem}
.legend{display:flex;flex-wrap:wrap;gap:.2rem 1.2rem;font-size:.8125rem;color:var(--soft);margin:0 0 .6rem;
max-width:none}
.legend span{display:inline-flex;align-items:center;gap:.4rem}
svg.key{width:1.1rem;height:.7rem;border-radius:2px}
svg.chart{width:100%;height:auto;overflow:visible}
.chart text,.map text{font-size:11.5px;fill:var(--soft)}
.chart text.title{fill:var(--ink);font-weight:600;font-size:13px}
.chart text.strong{fill:var(--ink)}
.axis{stroke:var(--line);stroke-width:1}.zero{stroke:var(--soft);stroke-width:1}
.given{fill:var(--given)}.better{fill:var(--better)}.measured{fill:var(--area)}
.line{fill:none;stroke-width:2;stroke-linejoin:round}.whisker{stroke-width:1;opacity:.55}
.line.given,.whisker.given{stroke:var(--given)}.line.better,.whisker.better{stroke:var(--better)}
.line.ideal{stroke:var(--soft);stroke-width:1;stroke-dasharray:4 3}
.dots{fill:none;stroke-linecap:round;stroke-width:3}
.dots.given{stroke:var(--given);opacity:.45}.dots.better{stroke:var(--better);opacity:.45}
.dots.knots{stroke-width:6;opacity:1}.wrap{white-space:pre-wrap;overflow-wrap:anywhere}
table.narrow{width:auto;min-width:min(34rem,100%)}
.f0{stroke:var(--f0)}.f1{stroke:var(--f1)}.f2{stroke:var(--f2)}.f3{stroke:var(--f3)}.f4{stroke:var(--f4)}
.f5{stroke:var(--f5)}
rect.f0{fill:var(--f0)}rect.f1{fill:var(--f1)}rect.f2{fill:var(--f2)}rect.f3{fill:var(--f3)}
rect.f4{fill:var(--f4)}rect.f5{fill:var(--f5)}
.map{width:100%;height:auto}
.photos{display:grid;grid-template-columns:repeat(5,1fr);gap:.35rem;margin:.4rem 0}
.photos figure{margin:0}.photos img{width:100%;height:auto;display:block;image-rendering:pixelated;border-radius:.2rem;
border:1px solid var(--line)}
.photos figcaption{margin-top:.2rem;text-align:center}
.maps{grid-template-columns:repeat(4,1fr);gap:.4rem 1rem}
.maps figcaption{margin-top:0;text-align:center}
.dot{fill:none;stroke-linecap:round}
.d0{stroke:var(--d0)}.d1{stroke:var(--d1)}.d2{stroke:var(--d2)}.d3{stroke:var(--d3)}.d4{stroke:var(--d4)}
.d5{stroke:var(--d5)}.d6{stroke:var(--d6)}
.scale rect{stroke:none}
.scale .d0{fill:var(--d0)}.scale .d1{fill:var(--d1)}.scale .d2{fill:var(--d2)}.scale .d3{fill:var(--d3)}
.scale .d4{fill:var(--d4)}.scale .d5{fill:var(--d5)}.scale .d6{fill:var(--d6)}
.t{stroke-width:.8;stroke-linejoin:round}
.t0{fill:var(--s0);stroke:var(--s0)}.t1{fill:var(--s1);stroke:var(--s1)}.t2{fill:var(--s2);stroke:var(--s2)}
.t3{fill:var(--s3);stroke:var(--s3)}.t4{fill:var(--s4);stroke:var(--s4)}
.arrow{stroke:var(--better);stroke-width:3.5;fill:none;stroke-linecap:round;stroke-linejoin:round}
.map text.label{fill:var(--ink);font-size:22px;font-weight:600;paint-order:stroke;stroke:var(--paper);
stroke-width:5px;stroke-linejoin:round}
#stage{display:none}
.js #stage{display:block}
canvas{display:block;width:100%;height:30rem;max-height:75vh;touch-action:pan-y;cursor:grab;border:1px solid var(--line);
border-radius:.5rem}
footer{margin-top:3.5rem;padding-top:1rem;border-top:1px solid var(--line);color:var(--soft);font-size:.8125rem}
.vh{position:absolute;width:1px;height:1px;overflow:hidden;clip-path:inset(50%);white-space:nowrap}
@media (max-width:40rem){main{padding:1.5rem 1rem 3rem}section{margin-top:2.5rem}
.maps{grid-template-columns:repeat(2,1fr)}canvas{height:20rem}
.ladder thead{position:absolute;clip-path:inset(50%)}
.ladder tr{display:grid;grid-template-columns:1fr auto;border-bottom:1px solid var(--line);padding:.4rem 0}
.ladder td{border:0;padding:.1rem 0}.ladder .barcell{grid-column:1/-1;grid-row:2;width:100%}
.ladder .more{grid-column:1/-1;text-align:left;font-size:.8125rem;color:var(--soft)}
.ladder .more:empty{display:none}.ladder .more::before{content:attr(data-label) " "}
dl,.rest{grid-template-columns:1fr;gap:0}dd{margin-bottom:.4rem}.ladder .name{min-width:0}}
@media print{:root{color-scheme:light;--paper:#fff;--wash:#f4f5f7;--ink:#000;--soft:#444;--line:#ccc;--given:#c8500a;
--better:#0b6bb0;--measured:#4a525c;--area:#c9ced5;--good:#1a7f4b;--warn:#6b4600;--warnwash:#fff;
--f0:#b4548a;--f1:#00805d;--f2:#b97d00;--f3:#3d7fc4;--f4:#7a55c7;--f5:#6b7280;
--d0:#40237a;--d1:#7760b6;--d2:#aa9bd3;--d3:#a9aeb4;--d4:#eeaf5c;--d5:#d97a14;--d6:#9a4600;
--s0:#c6ccd3;--s1:#d3d8de;--s2:#dfe3e8;--s3:#e9ecf0;--s4:#f1f3f6}
@page{margin:16mm 15mm}
html{font-size:9.5pt}body{font-size:1rem;-webkit-print-color-adjust:exact;print-color-adjust:exact}main{max-width:none;padding:0}
#stage,.js #stage,button{display:none}section{margin-top:1.6rem;padding-top:.8rem}
figure,tr,ol.steps>li,.warnings,.block{break-inside:avoid}figure:has(table){break-inside:auto}
h2,h3,h4,.about,thead{break-after:avoid}
.warnings{border:1px solid #999}pre{white-space:pre-wrap;border:1px solid #ccc}.scroll{overflow:visible}
.grid{grid-template-columns:repeat(2,1fr)}.hist{grid-template-columns:repeat(4,1fr)}.arrows{grid-template-columns:repeat(3,1fr)}.maps{grid-template-columns:repeat(4,1fr)}a{color:inherit}}
)css";
}

}  // namespace touchstone::client
