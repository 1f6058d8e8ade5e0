// What each candidate would explain, from inner products alone. An effect that acts on one object only is found by giving
// it to one object at a time: its columns are those of the effect on all objects, in the rows of one.
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "server/base/status.h"
#include "server/diagnosis/selection/stepwise_search.h"

namespace touchstone::diagnosis::selection {
namespace {

constexpr double kVisible = 1e-9;   // s of change at the typical size
constexpr int kMaxExactOnOne = 12;  // effects on one object that are scored under every hypothesis

// Inner products of the residual, the fit's own columns and those of the extensions, by hypothesis and object.
class ScoringGrams {
 public:
  ScoringGrams(const inference::Experiment& experiment, const inference::Likelihood::Columns& columns)
      : total_(experiment.likelihood->hypotheses().size()), by_group_(total_.size()) {
    const inference::Likelihood& likelihood = *experiment.likelihood;
    const std::vector<Eigen::MatrixXd> inner = likelihood.InnerByGroup(columns);
    const auto sum = [&](int begin, int end) {
      for (int s = begin; s < end; ++s) {
        by_group_[s] = likelihood.GramByGroup(columns, inner, s);
        total_[s] = std::accumulate(by_group_[s].begin() + 1, by_group_[s].end(), by_group_[s][0]);
      }
    };
    ParallelFor(experiment.pool, static_cast<int>(total_.size()), 4, sum);
  }

  const std::vector<Eigen::MatrixXd>& total() const { return total_; }

  // Of `members`, under hypothesis s; from member `first_on_one` on they have rows of one group only (-1: of all).
  Eigen::MatrixXd Of(const std::vector<int>& members, int first_on_one, int group, int s) const {
    const int size = static_cast<int>(members.size());
    Eigen::MatrixXd gram(size, size);
    for (int a = 0; a < size; ++a)
      for (int b = 0; b < size; ++b) {
        const bool on_one = std::max(a, b) >= first_on_one;
        gram(a, b) = (on_one ? by_group_[s][group] : total_[s])(members[a], members[b]);
      }
    return gram;
  }

 private:
  std::vector<Eigen::MatrixXd> total_;                  // [s]
  std::vector<std::vector<Eigen::MatrixXd>> by_group_;  // [s][group]
};

// One round of scores.
class Scorer {
 public:
  Scorer(const inference::Experiment& experiment, const inference::Fit& fit,
         std::vector<Extension>* extensions)
      : experiment_(experiment), fit_(fit), own_(fit.model.size()), extensions_(*extensions) {}

  absl::Status Run() {
    TOUCHSTONE_RETURN_IF_ERROR(Differentiate());
    const inference::Likelihood& likelihood = *experiment_.likelihood;
    const ScoringGrams grams(experiment_,
                             inference::Likelihood::Join(fit_.columns, likelihood.Prepare(wide_)));
    // Under two hypotheses first: bumps or none change little of the order.
    std::vector<int> all(likelihood.hypotheses().size()), few = {0};
    std::iota(all.begin(), all.end(), 0);
    if (fit_.hypothesis != 0) few.push_back(fit_.hypothesis);
    std::vector<int> on_one, exact;
    for (int m = 0; m < static_cast<int>(extensions_.size()); ++m)
      (extensions_[m].object.empty() ? exact : on_one).push_back(m);
    Evaluate(grams, on_one, few);
    std::sort(on_one.begin(), on_one.end(),
              [&](int a, int b) { return extensions_[a].log_evidence > extensions_[b].log_evidence; });
    if (on_one.size() > kMaxExactOnOne) on_one.resize(kMaxExactOnOne);
    exact.insert(exact.end(), on_one.begin(), on_one.end());
    Evaluate(grams, exact, all);
    return absl::OkStatus();
  }

 private:
  // The columns of every extension; those on one object share the columns of the effect on all.
  absl::Status Differentiate() {
    std::map<std::string, size_t> first_of_effect;
    const std::vector<std::string>& groups = experiment_.observations->groups();
    wide_.resize(fit_.columns.values.rows(), 0);
    for (Extension& extension : extensions_) {
      const int group =
          static_cast<int>(std::find(groups.begin(), groups.end(), extension.object) - groups.begin());
      group_.push_back(extension.object.empty() ? -1 : group);
      if (group_.back() >= 0) {
        first_column_.push_back(first_of_effect.at(extension.name));
      } else {
        TOUCHSTONE_ASSIGN_OR_RETURN(const Eigen::MatrixXd columns,
                                    inference::Derivatives(experiment_, extension.start,
                                                           extension.start.Start(), fit_.predicted, own_));
        first_column_.push_back(wide_.cols());
        first_of_effect.emplace(extension.name, wide_.cols());
        wide_.conservativeResize(Eigen::NoChange, wide_.cols() + columns.cols());
        wide_.rightCols(columns.cols()) = columns;
      }
      extension.visible = IsVisible(extension, first_column_.back(), group_.back());
    }
    return absl::OkStatus();
  }

  bool IsVisible(const Extension& extension, size_t first, int group) const {
    const int begin = group < 0 ? 0 : experiment_.observations->FirstRowOfGroup(group);
    const int rows = group < 0 ? static_cast<int>(wide_.rows())
                               : experiment_.observations->FirstRowOfGroup(group + 1) - begin;
    bool visible = false;
    for (int i = own_; i < extension.start.size(); ++i)
      visible |= wide_.col(static_cast<int>(first) + i - own_).segment(begin, rows).norm() *
                     extension.start.parameters()[i].scale >
                 kVisible * std::sqrt(static_cast<double>(rows));
    return visible;
  }

  void Evaluate(const ScoringGrams& grams, const std::vector<int>& which,
                const std::vector<int>& hypotheses) {
    const auto evaluate = [&](int begin, int end) {
      for (int at = begin; at < end; ++at) {
        Extension& extension = extensions_[which[at]];
        const int group = group_[which[at]], size = extension.start.size();
        std::vector<int> members(size + 1);
        for (int i = 0; i <= size; ++i)
          members[i] = i <= own_ ? i : static_cast<int>(first_column_[which[at]]) + i;
        const inference::Likelihood& likelihood = *experiment_.likelihood;
        if (group < 0) {
          extension.log_evidence =
              inference::ComputeLaplaceEvidence(likelihood, grams.total(), members,
                                                extension.start.parameters(), extension.start.Start())
                  .log_evidence;
          continue;
        }
        std::vector<int> in_order(size + 1);
        std::iota(in_order.begin(), in_order.end(), 0);
        std::vector<Eigen::MatrixXd> parts(grams.total().size());
        for (const int s : hypotheses) parts[s] = grams.Of(members, own_ + 1, group, s);
        extension.log_evidence =
            inference::ComputeLaplaceEvidence(likelihood, parts, in_order, extension.start.parameters(),
                                              extension.start.Start())
                .log_evidence;
      }
    };
    ParallelFor(experiment_.pool, static_cast<int>(which.size()), 1, evaluate);
  }

  const inference::Experiment& experiment_;
  const inference::Fit& fit_;
  const int own_;
  std::vector<Extension>& extensions_;
  Eigen::MatrixXd wide_;
  std::vector<size_t> first_column_;  // of wide_, per extension
  std::vector<int> group_;            // per extension; -1: all
};

}  // namespace

// What may extend the fit: effects of the model whose values are not free yet, and candidates that it lacks.
std::vector<Extension> StepwiseSearch::ListExtensions(const inference::Fit& fit, int initial_effects) const {
  std::vector<Extension> extensions;
  const model::Model& model = fit.model.base();
  for (int index = 0; index < initial_effects; ++index) {
    const model::Effect& own = *model.effects[index].effect;
    if (fit.model.IsFree(index) || own.random() || own.parameters.empty()) continue;
    Extension extension;
    extension.name = inference::NameOf(*model.effects[index].effect);
    extension.start = fit.model;
    extension.start.Free(index, true);
    extensions.push_back(std::move(extension));
  }
  for (int c = 0; c < static_cast<int>(candidates_.size()); ++c) {
    const std::string name = inference::NameOf(*candidates_[c].effect);
    const bool present =
        std::any_of(model.effects.begin(), model.effects.end(),
                    [&](const model::EffectInstance& e) { return inference::NameOf(*e.effect) == name; });
    if (present) continue;
    Extension extension;
    extension.candidate = c;
    extension.name = name;
    extension.object = candidates_[c].object;
    extension.start = fit.model;
    if (extension.object.empty())
      extension.start.Add(candidates_[c].effect, candidates_[c].per_object);
    else
      extension.start.AddOn(candidates_[c].effect, extension.object);
    extensions.push_back(std::move(extension));
  }
  return extensions;
}

absl::StatusOr<std::vector<Extension>> StepwiseSearch::Score(const inference::Fit& fit,
                                                             int initial_effects) const {
  std::vector<Extension> extensions = ListExtensions(fit, initial_effects);
  TOUCHSTONE_RETURN_IF_ERROR(Scorer(experiment_, fit, &extensions).Run());
  return extensions;
}

}  // namespace touchstone::diagnosis::selection
