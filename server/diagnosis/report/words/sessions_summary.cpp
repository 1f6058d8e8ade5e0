// Several sessions in sentences.
#include <algorithm>

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include "server/base/files/file_label.h"
#include "server/base/text/value_text.h"
#include "server/diagnosis/report/words/rules.h"
#include "server/diagnosis/report/words/summary.h"

namespace touchstone::diagnosis::report {
namespace {

constexpr double kMinP = 1e-300;

std::string ValueName(const joint::ComparedEffect& effect, const engine::ParameterEstimate& value) {
  return absl::StrCat(effect.effect, " ", value.name,
                      value.entry.empty() ? "" : absl::StrCat(" ", value.entry),
                      effect.object.empty() ? "" : absl::StrCat(" of ", effect.object));
}

// A value from session to session: those that agree together, of many runs the two that differ most.
std::string CourseInWords(const Sessions& sessions, const std::vector<DataReport>& data,
                          const joint::ComparedEffect& effect, const joint::ComparedValue& value) {
  const engine::ParameterEstimate& named = *value.by_session[value.from];
  std::vector<joint::SessionRun> runs = value.runs;
  const bool many = runs.size() < 2 || runs.size() > kWordsRules.max_runs;
  if (many) {
    runs.clear();
    for (const int session : {value.from, value.to})
      runs.push_back({{session}, {value.by_session[session]->value, value.by_session[session]->std_error}});
  }
  std::vector<std::string> parts;
  for (const joint::SessionRun& run : runs) {
    std::vector<std::string> names;
    for (const int session : run.sessions) names.push_back(SessionName(data, sessions.taking_part[session]));
    const size_t count = names.size();
    parts.push_back(absl::StrCat(ValueWithError(run.mean.value, run.mean.std_error), " ", named.unit, " in ",
                                 count > kWordsRules.max_names
                                     ? absl::StrCat(names.front(), " to ", names.back())
                                     : absl::StrJoin(names, " and ")));
  }
  return absl::StrCat(ValueName(effect, named), " from ", absl::StrJoin(parts, " to "),
                      many && value.runs.size() > kWordsRules.max_runs ? ", and in others between" : "");
}

std::string ChangedInWords(const Sessions& sessions, const std::vector<DataReport>& data,
                           const joint::ComparedEffect& effect) {
  std::vector<std::string> changes;
  for (const joint::ComparedValue& value : effect.entries) {
    if (value.change != joint::ValueChange::kChanged) continue;
    changes.push_back(CourseInWords(sessions, data, effect, value));
  }
  std::string words = absl::StrFormat("Changed: %s (by chance with p = %.1g).", absl::StrJoin(changes, "; "),
                                      std::max(effect.p, kMinP));
  if (!effect.equivalent.empty())
    absl::StrAppend(&words, " A change of ", absl::StrJoin(effect.equivalent, " or "),
                    " would explain the sessions as well.");
  return words;
}

std::string OthersInWords(const joint::SessionChanges& changes) {
  int unchanged = 0, unknown = 0, changed = 0;
  for (const joint::ComparedEffect& effect : changes.effects)
    for (const joint::ComparedValue& value : effect.entries) {
      changed += value.change == joint::ValueChange::kChanged;
      unchanged += value.change == joint::ValueChange::kUnchanged;
      unknown += value.change == joint::ValueChange::kCannotSay;
    }
  const char* const others = changed > 0 ? " other" : "";
  std::string words;
  if (changed == 0) words = "No value of the model changed between the sessions";
  if (unchanged > 0)
    absl::StrAppend(&words, changed == 0 ? ": " : "", unchanged, others,
                    unchanged == 1 ? " value is" : " values are",
                    " the same as far as the noise of one touch would show");
  if (unknown > 0)
    absl::StrAppend(&words,
                    unchanged > 0  ? ", and of "
                    : changed == 0 ? "; of "
                                   : "Of ",
                    unknown, unchanged > 0 ? "" : others, unknown == 1 ? " value" : " values",
                    " these sessions cannot say");
  return words.empty() ? "" : words + ".";
}

}  // namespace

std::string SessionName(const std::vector<DataReport>& data, int session) {
  std::vector<std::string> paths;
  for (const DataReport& one : data) paths.push_back(one.session);
  return FileLabel(paths, session);
}

std::string SessionsInWords(const Sessions& sessions, const std::vector<DataReport>& data,
                            const std::vector<int>& unexplained) {
  std::vector<std::string> sentences;
  if (sessions.changes) {
    for (const joint::ComparedEffect& effect : sessions.changes->effects)
      if (effect.values == joint::SessionValues::kOwn)
        sentences.push_back(ChangedInWords(sessions, data, effect));
    if (std::string others = OthersInWords(*sessions.changes); !others.empty())
      sentences.push_back(std::move(others));
  }
  for (const Sessions::Pair& pair : sessions.same_poses) {
    const bool modelled = sessions.changes && sessions.changes->moved();
    const touches::SamePoses& shown = modelled ? pair.left : pair.measured;
    if (shown.p >= kWordsRules.same_poses_p && sessions.same_poses.size() > 1) continue;
    sentences.push_back(absl::StrFormat(
        "On the %d poses that both %s and %s touched, contact times %sdiffer by %.3g ms from pose to pose, "
        "where noise lets expect %.3g ms (p = %.1g)%s",
        shown.poses, SessionName(data, pair.from), SessionName(data, pair.to),
        modelled ? "less what each session's model expects " : "", shown.rms_s * 1e3, shown.expected_s * 1e3,
        std::max(shown.p, kMinP),
        shown.p >= kWordsRules.same_poses_p ? "."
        : sessions.changes                  ? ": something changed that no value of the model describes."
                                            : ": the sessions differ, whatever the model."));
  }
  if (!unexplained.empty() && sessions.changes && sessions.changes->changed()) {
    std::vector<std::string> names;
    for (const int session : unexplained) names.push_back(SessionName(data, session));
    sentences.push_back(
        absl::StrCat("In ", absl::StrJoin(names, " and "),
                     " a rest remains that no effect explains: what changed may stand in for it."));
  }
  return absl::StrJoin(sentences, " ");
}

std::string SummarizeSessions(const Diagnosis& diagnosis, const std::vector<AskedByOne>& asked) {
  std::vector<std::string> sentences;
  for (size_t s = 0; s < diagnosis.data.size(); ++s) {
    const DataReport& data = diagnosis.data[s];
    if (!data.initial) continue;
    const bool better = data.final && data.final->rmse < data.initial->rmse;
    sentences.push_back(absl::StrCat(
        "In ", SessionName(diagnosis.data, static_cast<int>(s)), " the model is off by ",
        ErrorInWords(data.kind, data.initial->rmse),
        better ? absl::StrCat(", and by ", ErrorInWords(data.kind, data.final->rmse), " with what is found")
               : "",
        "."));
  }
  for (const Step& step : diagnosis.steps)
    sentences.push_back(absl::StrCat("Missing: ", step.effect, " (", ValuesInWords(step.parameters), ")."));
  for (const AskedByOne& one : asked)
    sentences.push_back(absl::StrCat(SessionName(diagnosis.data, one.session), " alone asks for ", one.effect,
                                     " beside it, which the other sessions do not show."));
  if (!diagnosis.sessions->words.empty()) sentences.push_back(diagnosis.sessions->words);
  return absl::StrJoin(sentences, " ");
}

}  // namespace touchstone::diagnosis::report
