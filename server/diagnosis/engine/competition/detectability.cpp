#include "server/diagnosis/engine/competition/detectability.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "server/base/numbers/distributions.h"
#include "server/base/numbers/normal.h"
#include "server/base/status.h"
#include "server/base/units.h"
#include "server/diagnosis/engine/competition/competition.h"
#include "server/diagnosis/engine/competition/expected_evidence.h"
#include "server/diagnosis/engine/competition/rules.h"
#include "server/diagnosis/engine/search/size_grid.h"
#include "server/model/parameter_values.h"

namespace touchstone::diagnosis::engine {
namespace {

// One value of an effect, and what a size of it means.
class SizedValue {
 public:
  SizedValue(const ExpectedEvidence& expected, const StepwiseSearch& search, int fingers, int m, int i)
      : parameter_(expected.extensions()[m].start.parameters()[i]) {
    const model::Effect& effect = *search.candidates()[expected.extensions()[m].candidate].effect;
    double sign = 1;
    reach_ = Reach(parameter_, &sign);
    int entry = 0;
    for (int j = 0; j < static_cast<int>(parameter_.weights.size()); ++j)
      if (std::abs(parameter_.weights[j]) > std::abs(parameter_.weights[entry])) entry = j;
    const model::ParameterInfo& info = effect.parameters[parameter_.parameter];
    entry_ = EntryName(info, entry - model::ValueOffset(effect, parameter_.parameter, fingers), fingers);
    weight_ = std::abs(parameter_.weights[entry]);
    si_ = SiFactor(info.unit);
  }

  double reach() const { return reach_; }
  double typical() const { return std::min(parameter_.scale, reach_); }
  const std::string& entry() const { return entry_; }
  // In the unit of files.
  double InFile(double size) const { return (parameter_.reciprocal ? 1 / size : weight_ * size) / si_; }
  double ErrorInFile(double error, double size) const {
    return parameter_.reciprocal ? error / (size * size) / si_ : InFile(error);
  }

 private:
  const FreeParameter& parameter_;
  double reach_ = 0, weight_ = 1, si_ = 1;
  std::string entry_;
};

class Detector {
 public:
  Detector(const StepwiseSearch& search, const Fit& given, const ExpectedEvidence& expected,
           const DetectionQuestion& question)
      : search_(search),
        fingers_(given.model.base().fingers),
        expected_(expected),
        extensions_(expected.extensions()),
        question_(question) {}

  absl::StatusOr<std::vector<DetectableValue>> Run(ThreadPool* pool) {
    struct Asked {
      int extension = 0, parameter = 0;
    };
    std::vector<Asked> asked;
    std::set<std::string> seen;
    for (int m = 0; m < static_cast<int>(extensions_.size()); ++m) {
      const Extension& extension = extensions_[m];
      if (extension.candidate < 0 || !extension.start.parameters().back().object.empty() ||
          !seen.insert(extension.name).second ||
          (!question_.effect.empty() && extension.name != question_.effect))
        continue;
      for (int i = expected_.own(); i < extension.start.size(); ++i) asked.push_back({m, i});
    }
    std::vector<absl::StatusOr<DetectableValue>> answers(asked.size());
    ParallelFor(pool, static_cast<int>(asked.size()), 1, [&](int begin, int end) {
      for (int at = begin; at < end; ++at) answers[at] = ValueOf(asked[at].extension, asked[at].parameter);
    });
    std::vector<DetectableValue> values;
    for (absl::StatusOr<DetectableValue>& answer : answers) {
      TOUCHSTONE_RETURN_IF_ERROR(answer.status());
      values.push_back(*std::move(answer));
    }
    return values;
  }

 private:
  // Whether the rows move at all.
  bool Moves(const ExpectedStep& step) const {
    return step.response.norm() >
           kCompetitionRules.no_response * expected_.sigma() * std::sqrt(expected_.rows());
  }

  // A size at which the rows move: *size, or the smallest on the grid. False: none.
  absl::StatusOr<bool> FindMove(int m, int i, bool together, double* size, ExpectedStep* step) const {
    std::vector<double> sizes = SizesOnGrid(extensions_[m].start.parameters()[i]);
    sizes.insert(sizes.begin(), *size);
    for (const double tried : sizes) {
      TOUCHSTONE_ASSIGN_OR_RETURN(*step, expected_.At(m, i, tried, together));
      if (!Moves(*step)) continue;
      *size = tried;
      return true;
    }
    return false;
  }

  // The extension that comes nearest to a response in evidence; -1: none resembles it. What its bounds keep from gaining
  // anything would have to act the other way.
  int NearestRival(int m, const ExpectedStep& step, double* correlation) const {
    std::vector<std::pair<double, int>> alike;
    for (int other = 0; other < static_cast<int>(extensions_.size()); ++other) {
      if (extensions_[other].name == extensions_[m].name) continue;
      if (!question_.rival.empty() && extensions_[other].name != question_.rival) continue;
      alike.emplace_back(std::sqrt(expected_.ShareExplainedBy(other, step)), other);
    }
    std::sort(alike.rbegin(), alike.rend());
    if (alike.size() > kCompetitionRules.max_rivals_compared)
      alike.resize(kCompetitionRules.max_rivals_compared);
    const bool any = !question_.rival.empty();
    int nearest = -1;
    double best = -INFINITY;
    const double without = expected_.Without(step).log_likelihood;
    for (const auto& [r, other] : alike) {
      if (r < kCompetitionRules.no_resemblance && !any) continue;
      const LaplaceEvidence with = expected_.Linear(step, other);
      if (with.log_evidence <= best ||
          (!any && with.log_likelihood < without + kCompetitionRules.no_gain_nats))
        continue;
      best = with.log_evidence;
      nearest = other;
      *correlation = r;
    }
    return nearest;
  }

  // How far a size is from being told apart: the squared size over the one needed; > 1: it is.
  double ToldApart(const ExpectedStep& e, const ExpectedRival& rival) const {
    const double ahead = e.log_evidence - rival.evidence.log_evidence;
    const double likelier = std::max(e.log_likelihood - rival.evidence.log_likelihood, 0.0);
    const double occam = ahead - likelier;
    // Twice the difference in log likelihood has this mean and, by the noise, four times it for a variance.
    const double z = kNormalQuantile80;
    const double needed = std::max(search_.rules().equivalent_nats - occam, 0.0);
    const double root =
        z + std::sqrt(z * z + 2 * needed);  // of 2 likelier, where likelier - z sqrt(2 likelier) = needed
    return 2 * likelier / std::max(root * root, 1e-12);
  }

  absl::StatusOr<DetectableValue> ValueOf(int m, int i) const {
    const SizedValue sized(expected_, search_, fingers_, m, i);
    const Extension& extension = extensions_[m];
    DetectableValue value;
    value.effect = search_.candidates()[extension.candidate].effect;
    value.parameter = extension.start.parameters()[i].parameter;
    value.entry = sized.entry();
    double size = sized.typical();
    value.typical = sized.InFile(size);
    ExpectedStep step;
    TOUCHSTONE_ASSIGN_OR_RETURN(bool alone, FindMove(m, i, false, &size, &step));
    const bool at_typical = alone && size == sized.typical();
    if (!alone) {
      // It acts with the effect's other values only, or not at all.
      TOUCHSTONE_ASSIGN_OR_RETURN(const bool together, FindMove(m, i, true, &size, &step));
      if (!together) return value;
    }
    const auto set_at = [&] {
      value.std_error = sized.ErrorInFile(std::sqrt(std::max(step.covariance(i, i), 0.0)), size);
      value.with_effect = std::make_shared<const model::Model>(extension.start.At(step.point));
    };
    set_at();
    if (!alone) return value;
    if (at_typical) value.power_at_typical = expected_.Power(m, step);
    const auto found_at = [&](const ExpectedStep& at) -> absl::StatusOr<double> {
      const int values = extension.start.size() - expected_.own();
      return at.ratio /
             NoncentralityForTail(expected_.RatioNeeded(m, at), values, kCompetitionRules.detection_power);
    };
    TOUCHSTONE_ASSIGN_OR_RETURN(const bool found, Grow(m, i, sized.reach(), found_at, &size, &step));
    if (found) {
      value.found_from = sized.InFile(size);
      set_at();
    }
    TOUCHSTONE_RETURN_IF_ERROR(TellApart(m, i, sized, size, std::move(step), &value));
    return value;
  }

  // Sets the rival, and from which size the effect is told from it. `step`: at `size`, which is that of value->found_from if
  // there is one.
  absl::Status TellApart(int m, int i, const SizedValue& sized, double size, ExpectedStep step,
                         DetectableValue* value) const {
    const int rival = NearestRival(m, step, &value->correlation);
    if (rival < 0) {
      value->told_from = value->found_from;
      return absl::OkStatus();
    }
    const Extension& other = extensions_[rival];
    value->rival = other.candidate < 0 ? absl::StrCat(kGivenPrefix, other.name) : other.name;
    TOUCHSTONE_ASSIGN_OR_RETURN(const ExpectedRival fitted, expected_.Fitted(step, rival));
    value->with_rival = std::make_shared<const model::Model>(other.start.At(fitted.point));
    if (!value->found_from) return absl::OkStatus();
    // What acts as the effect does is stopped by its bounds alone, and they tell nothing; nor does its number of values where
    // it is known to hold the effect as a part.
    const bool alike =
        1 - value->correlation * value->correlation < kCompetitionRules.alike * kCompetitionRules.alike;
    if (alike && (IsDeclaredConfounded(*value->effect, other.name) ||
                  other.start.size() <= extensions_[m].start.size()))
      return absl::OkStatus();
    if (ToldApart(step, fitted) < 1) {
      const auto told_at = [&](const ExpectedStep& at) -> absl::StatusOr<double> {
        TOUCHSTONE_ASSIGN_OR_RETURN(const ExpectedRival again, expected_.Fitted(at, rival));
        return ToldApart(at, again);
      };
      TOUCHSTONE_ASSIGN_OR_RETURN(const bool told, Grow(m, i, sized.reach(), told_at, &size, &step));
      if (!told) return absl::OkStatus();
    }
    value->told_from = sized.InFile(size);
    return absl::OkStatus();
  }

  // Changes *size until what grows as its square, or in steps, is 1 there. False: it is not, up to `reach`.
  template <typename Measure>
  absl::StatusOr<bool> Grow(int m, int i, double reach, const Measure& measure, double* size,
                            ExpectedStep* e) const {
    const double growth = kCompetitionRules.max_growth;
    double below = 0, above = INFINITY;  // sizes that are too small, and large enough
    for (int step = 0; step < kCompetitionRules.max_size_steps; ++step) {
      TOUCHSTONE_ASSIGN_OR_RETURN(const double reached, measure(*e));
      const double factor = std::clamp(1 / std::sqrt(std::max(reached, 1e-12)), 1 / growth, growth);
      if (std::abs(factor - 1) < kCompetitionRules.size_tolerance) return true;
      if (*size >= reach && factor > 1) return false;
      (factor > 1 ? below : above) = *size;
      double next = std::min(*size * factor, reach);
      if (below > 0 && std::isfinite(above) && (next <= below || next >= above))
        next = std::sqrt(below * above);
      *size = next;
      TOUCHSTONE_ASSIGN_OR_RETURN(*e, expected_.At(m, i, *size, false));
    }
    TOUCHSTONE_ASSIGN_OR_RETURN(const double reached, measure(*e));
    if (reached > 1 - 2 * kCompetitionRules.size_tolerance) return true;
    if (!std::isfinite(above)) return false;
    *size = above;
    TOUCHSTONE_ASSIGN_OR_RETURN(*e, expected_.At(m, i, *size, false));
    return true;
  }

  const StepwiseSearch& search_;
  const int fingers_;
  const ExpectedEvidence& expected_;
  const std::vector<Extension>& extensions_;
  const DetectionQuestion& question_;
};

}  // namespace

absl::StatusOr<std::vector<DetectableValue>> FindDetectable(const StepwiseSearch& search, const Fit& given,
                                                            int initial_effects, double sigma,
                                                            const DetectionQuestion& question) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const ExpectedEvidence expected,
                              ExpectedEvidence::Create(search, given, initial_effects, sigma));
  return Detector(search, given, expected, question).Run(search.experiment().pool);
}

}  // namespace touchstone::diagnosis::engine
