// Several sessions in the terminal: how wrong the model is in each, and which values changed.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>

#include "client/report/report.h"
#include "client/report/terminal/terminal_parts.h"
#include "client/report/words/error_scale.h"
#include "client/report/words/words.h"

namespace touchstone::client {
namespace {

using TextCell = TextLayout::Cell;

constexpr int kMaxColumns = 3;  // sessions beside one another; of more, the two that differ most

std::string ChangeInWords(const v1::ComparedValue& value, double p) {
  switch (value.change()) {
    case v1::ComparedEffect::CHANGED:
      return absl::StrCat("changed by ", value.difference() > 0 ? "+" : "",
                          ValueWithError(value.difference(), value.std_error(), value.unit()), " (p ",
                          Probability(p), ")");
    case v1::ComparedEffect::UNCHANGED:
      return absl::StrCat(
          "unchanged, within ",
          SizeInUnit(std::max(std::abs(value.lower()), std::abs(value.upper())), value.unit()));
    default:
      return value.std_error() > 0 ? absl::StrCat("cannot say: ", SizeInUnit(value.lower(), value.unit()),
                                                  " to ", SizeInUnit(value.upper(), value.unit()))
                                   : "cannot say";
  }
}

std::string NameOfValue(const v1::ComparedEffect& effect, const v1::ComparedValue& value) {
  return absl::StrCat(effect.effect(), " ", value.name(),
                      value.finger().empty() ? "" : absl::StrCat(" ", value.finger()),
                      effect.object().empty() ? "" : absl::StrCat(" of ", effect.object()));
}

const v1::SessionValue* OfSession(const v1::ComparedValue& value, int session) {
  for (const v1::SessionValue& one : value.sessions())
    if (static_cast<int>(one.session()) == session) return &one;
  return nullptr;
}

std::string InSession(const v1::ComparedValue& value, int session) {
  const v1::SessionValue* one = OfSession(value, session);
  return one == nullptr ? "-"
                        : absl::StrCat(ValueWithError(one->value(), one->std_error(), value.unit()),
                                       one->outside() ? " !" : "");
}

void AddErrors(const v1::Report& report, TextLayout* out) {
  out->Label("How wrong");
  std::vector<std::vector<TextCell>> rows;
  for (int s = 0; s < report.data_size(); ++s) {
    const v1::DataReport& data = report.data(s);
    const ErrorScale scale(data);
    const double before = data.initial().rmse(), after = data.final().rmse();
    rows.push_back({{SessionLabel(report, s)},
                    {absl::StrCat(Count(data.count()), " ", scale.Counted(data.count())), true},
                    {before > 0 ? scale.Text(before) : "-", true},
                    {after > 0 && after < before ? absl::StrCat("-> ", scale.Text(after)) : "", true},
                    {data.noise_floor() > 0 ? absl::StrCat("floor ", scale.Text(data.noise_floor())) : "",
                     true, TextLayout::kDim}});
  }
  out->Rows(rows);
}

// One value, a line a session: where it lies between the limits that the other sessions let expect.
void AddChart(const v1::Report& report, const v1::ComparedEffect& effect, const v1::ComparedValue& value,
              TextLayout* out) {
  constexpr int kChart = 25;
  double low = INFINITY, high = -INFINITY;
  for (const v1::SessionValue& one : value.sessions()) {
    const bool limited = one.limit_upper() > one.limit_lower();
    low = std::min({low, one.value(), limited ? one.limit_lower() : one.value() - 3 * one.std_error()});
    high = std::max({high, one.value(), limited ? one.limit_upper() : one.value() + 3 * one.std_error()});
  }
  if (!(high > low)) return;
  const auto column = [&](double at) {
    return std::clamp(static_cast<int>(std::lround((at - low) / (high - low) * (kChart - 1))), 0, kChart - 1);
  };
  out->Label(value.change() == v1::ComparedEffect::CHANGED     ? "Changed"
             : value.change() == v1::ComparedEffect::UNCHANGED ? "Unchanged"
                                                               : "Cannot say");
  out->Paragraph(
      absl::StrCat(NameOfValue(effect, value),
                   value.between_sessions() > 0
                       ? absl::StrCat(": scatters by ", SizeInUnit(value.between_sessions(), value.unit()),
                                      " between sessions, beyond its standard errors")
                       : ""));
  std::vector<std::vector<TextCell>> rows;
  for (const v1::SessionValue& one : value.sessions()) {
    std::string chart(kChart, ' ');
    if (one.limit_upper() > one.limit_lower()) {
      chart[column(one.limit_lower())] = '|';
      chart[column(one.limit_upper())] = '|';
    }
    chart[column(one.value())] = one.outside() ? 'X' : 'o';
    rows.push_back({{SessionLabel(report, static_cast<int>(one.session()))},
                    {ValueWithError(one.value(), one.std_error(), value.unit()), true},
                    {chart, false, one.outside() ? TextLayout::kBad : TextLayout::kBar},
                    {one.outside() ? "outside" : ""}});
  }
  out->Rows(rows);
  out->Blank();
}

}  // namespace

std::string TerminalHistory(const v1::Report& report, int width, bool colour) {
  TextLayout out(width, colour);
  out.Lead(absl::StrCat(report.data_size(), " sessions, model '", report.model_name(), "'."));
  for (const std::string& warning : report.warnings())
    out.Lead(absl::StrCat("Note: ", warning), TextLayout::kBad);
  out.Blank();
  AddDataProblems(report, &out);
  AddErrors(report, &out);
  out.Blank();
  const v1::SessionComparison& sessions = report.sessions();
  if (!sessions.words().empty()) {
    out.Label("Changes");
    out.Paragraph(sessions.words());
    out.Blank();
  }
  for (const v1::ComparedEffect& effect : sessions.effects())
    for (const v1::ComparedValue& value : effect.values()) AddChart(report, effect, value, &out);
  out.Lead(
      "o a session's value, X one outside the limits: three standard deviations round the mean of the "
      "other sessions, of four or more.",
      TextLayout::kDim);
  return out.Take();
}

void AddSessions(const v1::Report& report, TextLayout* out) {
  if (!report.has_sessions()) return;
  const v1::SessionComparison& sessions = report.sessions();
  AddErrors(report, out);
  out->Label("Sessions");
  if (!sessions.words().empty()) out->Paragraph(sessions.words(), TextLayout::kBold);
  const int count = report.data_size();
  std::vector<std::vector<TextCell>> rows = {{{""}}};
  if (count <= kMaxColumns)
    for (int s = 0; s < count; ++s) rows[0].push_back({SessionLabel(report, s), true, TextLayout::kDim});
  for (const v1::ComparedEffect& effect : sessions.effects())
    for (const v1::ComparedValue& value : effect.values()) {
      std::vector<TextCell> row = {{NameOfValue(effect, value)}};
      if (count <= kMaxColumns)
        for (int s = 0; s < count; ++s) row.push_back({InSession(value, s), true});
      else
        for (const auto session : {value.from_session(), value.to_session()})
          row.push_back({absl::StrCat(SessionLabel(report, static_cast<int>(session)), ": ",
                                      InSession(value, static_cast<int>(session)))});
      const bool changed = value.change() == v1::ComparedEffect::CHANGED;
      row.push_back(
          {ChangeInWords(value, effect.p()), false, changed ? TextLayout::kBad : TextLayout::kPlain});
      rows.push_back(row);
    }
  if (rows.size() > 1) out->Rows(rows);
}

}  // namespace touchstone::client
