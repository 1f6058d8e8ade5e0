// One question in the terminal: why (not) one effect, which of two models.
#include <absl/strings/str_cat.h>
#include <absl/strings/strip.h>

#include <cmath>

#include "client/report/report.h"
#include "client/report/terminal/terminal_parts.h"
#include "client/report/words/error_scale.h"
#include "client/report/words/words.h"

namespace touchstone::client {
namespace {

using TextCell = TextLayout::Cell;

constexpr double kNothing = 1e-3;  // nats

void AddDeciding(const std::string& label,
                 const google::protobuf::RepeatedPtrField<v1::DecidingMeasurement>& touches,
                 const ErrorScale& scale, TextLayout* out) {
  if (touches.empty()) return;
  out->Label(label);
  std::vector<std::vector<TextCell>> rows;
  for (const v1::DecidingMeasurement& touch : touches)
    rows.push_back({{absl::StrCat("touch ", touch.touch())},
                    {touch.object()},
                    {absl::StrCat("finger ", touch.finger())},
                    {absl::StrCat(scale.Signed(touch.before()), " -> ", scale.Signed(touch.after())), true}});
  out->Rows(rows);
}

void AddSlices(const std::string& label, const google::protobuf::RepeatedPtrField<v1::Slice>& slices,
               const ErrorScale& scale, TextLayout* out) {
  if (slices.empty()) return;
  out->Label(label);
  std::vector<std::vector<TextCell>> rows;
  for (const v1::Slice& slice : slices)
    rows.push_back({{slice.slice()},
                    {absl::StrCat(Count(slice.count()), " ", scale.readings()), true},
                    {Share(slice.share_of_excess_error()), true}});
  out->Rows(rows);
}

}  // namespace

void AddVersus(const v1::Report& report, TextLayout* out) {
  if (report.data_size() != 1 || !report.data(0).has_versus()) return;
  const v1::DataReport& data = report.data(0);
  const v1::ModelComparison& versus = data.versus();
  const ErrorScale scale(data);
  out->Label("Two models");
  out->Paragraph(versus.words(), TextLayout::kBold);
  out->Rows({{{absl::StrCat("'", report.model_name(), "'")}, {scale.Text(data.initial().rmse()), true}},
             {{absl::StrCat("'", versus.other_name(), "'")}, {scale.Text(versus.other().rmse()), true}}});
  // Of models that expect the same, none errs less in any.
  if (versus.lower() != 0 || versus.upper() != 0)
    out->Paragraph(absl::StrCat("Of 1000 draws of poses, '", versus.other_name(), "' errs less in ",
                                Share(versus.other_better()), "."));
  AddSlices("Better in", versus.better(), scale, out);
  AddSlices("Worse in", versus.worse(), scale, out);
  AddDeciding("Deciding", versus.deciding(), scale, out);
}

std::string TerminalExplanation(const v1::Report& report, int width, bool colour) {
  TextLayout out(width, colour);
  const v1::ExplainedEffect& explained = report.explained();
  if (report.data_size() > 0) {
    const v1::DataReport& data = report.data(0);
    out.Lead(absl::StrCat(data.session().empty() ? "" : absl::StrCat(data.session(), ": "),
                          Count(data.count()), " ", ErrorScale(data).Counted(data.count()), ", model '",
                          report.model_name(), "'.", NoiseFloorSentence(data)));
  }
  for (const std::string& warning : report.warnings())
    out.Lead(absl::StrCat("Note: ", warning), TextLayout::kBad);
  out.Blank();
  out.Lead(explained.words(), TextLayout::kBold);
  out.Blank();
  // What changes nothing has nothing to show.
  if (report.data_size() == 0 || !(explained.gain_nats() > kNothing)) return out.Take();
  const v1::DataReport& data = report.data(0);
  const ErrorScale scale(data);
  out.Label("Values");
  std::vector<std::vector<TextCell>> rows;
  for (const v1::ParameterValue& value : explained.parameters())
    rows.push_back(
        {{ParameterName(value)}, {ValueWithError(value)}, {absl::StrCat("95 %: ", Interval(value))}});
  out.Rows(rows);
  out.Label("Error");
  out.Rows({{{"the model as it is"}, {scale.Text(data.initial().rmse()), true}},
            {{absl::StrCat("with ", explained.effect())}, {scale.Text(explained.rmse()), true}},
            {{"... on unseen touches"}, {scale.Text(explained.heldout_rmse()), true}},
            {{"noise floor"}, {scale.Text(data.noise_floor()), true, TextLayout::kDim}}});
  out.Label("Probability");
  out.Paragraph(absl::StrCat(EffectProbability(explained.probability()),
                             " that it is the one effect that is missing; gain ",
                             Number(explained.gain_nats()), " nats."));
  if (!explained.taken_over().empty()) {
    out.Label("Taken over");
    std::vector<std::vector<TextCell>> taken;
    for (const v1::TakenOver& other : explained.taken_over()) {
      const absl::string_view name = absl::StripPrefix(other.effect(), "given:");
      taken.push_back({{absl::StrCat(name, name.size() < other.effect().size() ? " of the model" : "")},
                       {absl::StrCat(Share(other.share()), " of what it does"), true},
                       {absl::StrCat("alone ", Number(other.gain_nats()), " nats"), true}});
    }
    out.Rows(taken);
  }
  AddDeciding("For it", explained.speak_for(), scale, &out);
  AddDeciding("Against it", explained.speak_against(), scale, &out);
  return out.Take();
}

}  // namespace touchstone::client
