// What a plan can find, in the terminal.
#include <absl/strings/str_cat.h>
#include <absl/strings/strip.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "client/report/report.h"
#include "client/report/terminal/terminal_parts.h"
#include "client/report/words/words.h"

namespace touchstone::client {
namespace {

using TextCell = TextLayout::Cell;

constexpr double kMinPower =
    0.1;                        // power at the usual size, from which an effect is no blind spot at any size
constexpr double kPower = 0.8;  // that found_from and told_from mean
constexpr int kWideColumns = 100;  // from where what rigs show has a column
constexpr double kTied = 0.9995;   // correlation

std::string Size(double size, const v1::DetectableEffect& value) {
  return value.unit().empty() ? Number(size, 2) : absl::StrCat(Number(size, 2), " ", value.unit());
}

// Of a value that acts by its inverse a smaller one is found where the usual one is not.
bool LessActsMore(const v1::DetectableEffect& value) {
  return value.has_found_from() && value.found_from() < value.typical() && value.power_at_typical() < kPower;
}

std::string ValueName(const v1::DetectableEffect& value) {
  return value.finger().empty() ? value.parameter() : absl::StrCat(value.parameter(), " ", value.finger());
}

std::string RivalName(const v1::DetectableEffect& value) {
  const absl::string_view name = absl::StripPrefix(value.rival(), "given:");
  return absl::StrCat(name, name.size() < value.rival().size() ? " of the model" : "");
}

std::string ToldFrom(const v1::DetectableEffect& value) {
  if (!value.has_found_from()) return "";
  if (value.rival().empty()) return "at once";
  if (!value.has_told_from())
    return absl::StrCat(value.correlation() > kTied ? "never: acts as " : "never from ", RivalName(value));
  if (value.told_from() <= 1.05 * value.found_from()) return "at once";
  return absl::StrCat(Size(value.told_from(), value), " from ", RivalName(value));
}

std::string Power(const v1::DetectableEffect& value) {
  if (!(value.std_error() > 0)) return "none";
  return absl::StrCat(std::lround(100 * value.power_at_typical()), " %");
}

void AddTable(const v1::Report& report, TextLayout* out) {
  const bool wide = out->width() >= kWideColumns;
  std::vector<std::vector<TextCell>> rows;
  std::vector<TextCell> head = {{"effect"}, {"found from", true}};
  if (wide) head.push_back({"rigs show", true});
  head.push_back({"power", true});
  head.push_back({"told apart from"});
  for (TextCell& cell : head) cell.style = TextLayout::kDim;
  rows.push_back(head);
  std::map<std::string, int> values;
  for (const v1::DetectableEffect& value : report.detectable()) ++values[value.effect()];
  std::string last;
  for (const v1::DetectableEffect& value : report.detectable()) {
    // An effect of one value has one row, one of several a row for each.
    const bool one = values[value.effect()] == 1;
    if (!one && value.effect() != last) rows.push_back({{value.effect()}});
    last = value.effect();
    const TextLayout::Style style = value.power_at_typical() < kPower ? TextLayout::kBad : TextLayout::kPlain;
    std::vector<TextCell> row = {{one ? value.effect() : absl::StrCat("  ", ValueName(value))},
                                 {value.has_found_from() ? Size(value.found_from(), value) : "-", true}};
    if (wide) row.push_back({Size(value.typical(), value), true});
    row.push_back({Power(value), true, style});
    row.push_back({ToldFrom(value)});
    rows.push_back(std::move(row));
  }
  out->Rows(rows);
}

// Each measurement that would part two effects, once.
void AddParting(const v1::Report& report, TextLayout* out) {
  std::map<std::string, std::set<std::string>> pairs;
  std::vector<std::string> order;
  for (const v1::DetectableEffect& value : report.detectable()) {
    if (value.parted_by().empty()) continue;
    const std::string pair = absl::StrCat(value.effect(), " from ", RivalName(value));
    if (pairs[value.parted_by()].empty()) order.push_back(value.parted_by());
    pairs[value.parted_by()].insert(pair);
  }
  if (order.empty()) return;
  out->Label("To tell");
  for (const std::string& measurement : order)
    out->Paragraph(
        absl::StrCat(Join({pairs[measurement].begin(), pairs[measurement].end()}, "and"), ": ", measurement),
        TextLayout::kPlain, 2);
}

}  // namespace

void AddBlindSpots(const v1::Report& report, TextLayout* out) {
  std::map<std::string, const v1::DetectableEffect*> best;
  std::vector<std::string> order;
  for (const v1::DetectableEffect& value : report.detectable()) {
    const v1::DetectableEffect*& shown = best[value.effect()];
    if (shown == nullptr) order.push_back(value.effect());
    if (shown == nullptr || value.power_at_typical() > shown->power_at_typical()) shown = &value;
  }
  std::vector<std::string> blind;
  for (const std::string& effect : order) {
    const v1::DetectableEffect& value = *best[effect];
    if (value.power_at_typical() >= kPower) continue;
    blind.push_back(
        value.has_found_from() ? absl::StrCat(effect, LessActsMore(value) ? " above " : " below ",
                                              Size(value.found_from(), value))
        : value.power_at_typical() >= kMinPower
            ? absl::StrCat(effect, " for sure (", Share(value.power_at_typical()), " at the usual size)")
            : absl::StrCat(effect, " at any size"));
  }
  if (blind.empty()) return;
  out->Label("Blind to");
  out->Paragraph(
      absl::StrCat("This set could not have shown ", Join(blind, "or"), ": rigs usually show less."));
}

std::string TerminalCheck(const v1::Report& report, int width, bool colour) {
  TextLayout out(width, colour);
  if (report.data_size() > 0) {
    const v1::DataReport& data = report.data(0);
    out.Lead(absl::StrCat(
        "Plan ", data.session().empty() ? "" : absl::StrCat(data.session(), ": "), Count(data.count()),
        " touches on ",
        data.set().objects_size() == 1 ? "one object" : absl::StrCat(data.set().objects_size(), " objects"),
        ", noise ", Time(data.noise_floor()), ", model '", report.model_name(), "'."));
  }
  for (const std::string& warning : report.warnings())
    out.Lead(absl::StrCat("Note: ", warning), TextLayout::kBad);
  out.Blank();
  out.Lead(report.summary(), TextLayout::kBold);
  out.Blank();
  out.Label("Effects");
  AddTable(report, &out);
  out.Blank();
  AddParting(report, &out);
  out.Paragraph(
      absl::StrCat("Found from: the size that a diagnosis of such a set finds in ", Share(kPower),
                   " of sets. Power: the share in which it finds the size that rigs usually show; none: the "
                   "plan says nothing about the value, or it acts with other values only."),
      TextLayout::kDim);
  AddUnusedRows(report, &out);
  return out.Take();
}

}  // namespace touchstone::client
