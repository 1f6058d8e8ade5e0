// What each candidate would explain, from inner products alone. An effect that acts on one object only is found by giving
// it to one object at a time: its columns are those of the effect on all objects, in the rows of one. So are those of an
// effect that differs from object to object.
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "server/base/status.h"
#include "server/diagnosis/engine/search/grid_scores.h"
#include "server/diagnosis/engine/search/rules.h"
#include "server/diagnosis/engine/search/stepwise_search.h"

namespace touchstone::diagnosis::engine {
namespace {

// Inner products of the residual, the fit's own columns and those of the extensions, under one hypothesis.
class ScoringGram {
 public:
  // A column with the rows of one group only (-1: of all).
  struct Member {
    int column = 0, group = -1;
  };

  explicit ScoringGram(std::vector<Eigen::MatrixXd> by_group) : by_group_(std::move(by_group)) {
    total_ = by_group_[0];
    for (size_t group = 1; group < by_group_.size(); ++group) total_ += by_group_[group];
  }

  Eigen::MatrixXd Of(const std::vector<Member>& members) const {
    const int size = static_cast<int>(members.size());
    Eigen::MatrixXd gram(size, size);
    for (int a = 0; a < size; ++a)
      for (int b = 0; b <= a; ++b) gram(a, b) = gram(b, a) = Product(members[a], members[b]);
    return gram;
  }

 private:
  double Product(const Member& a, const Member& b) const {
    const int group = std::max(a.group, b.group);
    if (group < 0) return total_(a.column, b.column);
    if (a.group >= 0 && b.group >= 0 && a.group != b.group) return 0;
    return by_group_[group](a.column, b.column);
  }

  Eigen::MatrixXd total_;
  std::vector<Eigen::MatrixXd> by_group_;
};

// One round of scores.
class Scorer {
 public:
  Scorer(const Experiment& experiment, const Fit& fit, std::vector<Extension>* extensions)
      : experiment_(experiment), fit_(fit), own_(fit.model.size()), extensions_(*extensions) {}

  absl::Status Run() {
    TOUCHSTONE_RETURN_IF_ERROR(Differentiate());
    columns_ = Likelihood::Join(fit_.columns, experiment_.likelihood->Prepare(wide_));
    inner_ = experiment_.likelihood->InnerByGroup(columns_);
    std::vector<int> screened, exact;
    for (int m = 0; m < static_cast<int>(extensions_.size()); ++m)
      (SharesColumns(extensions_[m]) ? screened : exact).push_back(m);
    EvaluateEach(screened, Few());
    std::sort(screened.begin(), screened.end(),
              [&](int a, int b) { return extensions_[a].log_evidence > extensions_[b].log_evidence; });
    if (screened.size() > kCandidateRules.max_exact_on_one) screened.resize(kCandidateRules.max_exact_on_one);
    exact.insert(exact.end(), screened.begin(), screened.end());
    EvaluateEach(exact, All());
    return absl::OkStatus();
  }

  // After Run.
  std::vector<PairOfExtensions> Pairs() const {
    std::vector<PairOfExtensions> pairs;
    std::vector<Sized> sized;
    for (int a = 0; a < static_cast<int>(extensions_.size()); ++a)
      for (int b = a + 1; b < static_cast<int>(extensions_.size()); ++b) {
        if (!ActsOnAll(extensions_[a]) || !ActsOnAll(extensions_[b])) continue;
        if (extensions_[a].name == extensions_[b].name) continue;
        pairs.push_back({a, b});
        sized.push_back(Join(a, b));
      }
    const std::vector<double> log_evidence = Evaluate(sized, Few());
    for (size_t at = 0; at < pairs.size(); ++at) pairs[at].log_evidence = log_evidence[at];
    std::stable_sort(pairs.begin(), pairs.end(), [](const PairOfExtensions& a, const PairOfExtensions& b) {
      return a.log_evidence > b.log_evidence;
    });
    return pairs;
  }

 private:
  // Columns with the parameters that they belong to.
  struct Sized {
    std::vector<ScoringGram::Member> members;
    std::vector<FreeParameter> parameters;
    Eigen::VectorXd point;
  };

  // Two hypotheses: bumps or none change little of an order.
  std::vector<int> Few() const {
    return fit_.hypothesis == 0 ? std::vector<int>{0} : std::vector<int>{0, fit_.hypothesis};
  }
  std::vector<int> All() const {
    std::vector<int> all(experiment_.likelihood->hypotheses().size());
    std::iota(all.begin(), all.end(), 0);
    return all;
  }

  static bool ActsOnAll(const Extension& extension) {
    return extension.visible && !extension.rare && extension.object.empty();
  }

  Sized Alone(int extension) const {
    const Parameterization& start = extensions_[extension].start;
    return {MembersOf(extensions_[extension], first_column_[extension]), start.parameters(), start.Start()};
  }
  // What the second has beyond the fit stands behind the first.
  Sized Join(int first, int second) const {
    Sized both = Alone(first);
    const Sized other = Alone(second);
    both.members.insert(both.members.end(), other.members.begin() + 1 + own_, other.members.end());
    both.parameters.insert(both.parameters.end(), other.parameters.begin() + own_, other.parameters.end());
    Eigen::VectorXd point(both.point.size() + other.point.size() - own_);
    point << both.point, other.point.tail(other.point.size() - own_);
    both.point = std::move(point);
    return both;
  }

  // Whether the columns are those of the same effect on all objects, object by object.
  bool SharesColumns(const Extension& extension) const {
    return extension.candidate >= 0 && extension.start.size() > own_ &&
           !extension.start.parameters().back().object.empty();
  }

  // The columns of every extension.
  absl::Status Differentiate() {
    std::map<std::string, int> first_of_effect;
    wide_.resize(fit_.columns.values.rows(), 0);
    for (Extension& extension : extensions_) {
      if (SharesColumns(extension)) {
        first_column_.push_back(first_of_effect.at(extension.name));
      } else {
        TOUCHSTONE_ASSIGN_OR_RETURN(
            const Eigen::MatrixXd columns,
            Derivatives(experiment_, extension.start, extension.start.Start(), fit_.predicted, own_));
        const int first = static_cast<int>(wide_.cols());
        first_column_.push_back(first);
        if (extension.candidate >= 0) first_of_effect.emplace(extension.name, first);
        wide_.conservativeResize(Eigen::NoChange, first + columns.cols());
        wide_.rightCols(columns.cols()) = columns;
      }
      extension.visible = IsVisible(extension, MembersOf(extension, first_column_.back()));
    }
    return absl::OkStatus();
  }

  // The residual, the fit's own columns and those of the extension, among the fit's and wide_ together.
  std::vector<ScoringGram::Member> MembersOf(const Extension& extension, int first) const {
    const std::vector<FreeParameter>& parameters = extension.start.parameters();
    const std::vector<std::string>& groups = experiment_.observations->groups();
    std::vector<ScoringGram::Member> members;
    for (int i = 0; i <= own_; ++i) members.push_back({i, -1});
    for (int i = own_; i < extension.start.size(); ++i) {
      if (!SharesColumns(extension)) {
        members.push_back({1 + first + i, -1});
        continue;
      }
      const int group =
          static_cast<int>(std::find(groups.begin(), groups.end(), parameters[i].object) - groups.begin());
      members.push_back({1 + own_ + first + parameters[i].shape - parameters[own_].shape, group});
    }
    return members;
  }

  bool IsVisible(const Extension& extension, const std::vector<ScoringGram::Member>& members) const {
    bool visible = false;
    for (int i = own_; i < extension.start.size(); ++i) {
      const ScoringGram::Member& member = members[1 + i];
      const int group = member.group;
      const int begin = group < 0 ? 0 : experiment_.observations->FirstRowOfGroup(group);
      const int end =
          group < 0 ? static_cast<int>(wide_.rows()) : experiment_.observations->FirstRowOfGroup(group + 1);
      visible |= wide_.col(member.column - 1 - own_).segment(begin, end - begin).norm() *
                     extension.start.parameters()[i].scale >
                 kCandidateRules.visible_change * std::sqrt(static_cast<double>(end - begin));
    }
    return visible;
  }

  void EvaluateEach(const std::vector<int>& which, const std::vector<int>& hypotheses) {
    std::vector<Sized> sized;
    for (const int m : which) sized.push_back(Alone(m));
    const std::vector<double> log_evidence = Evaluate(sized, hypotheses);
    for (size_t at = 0; at < which.size(); ++at) extensions_[which[at]].log_evidence = log_evidence[at];
  }

  // The evidence of each, averaged over the hypotheses.
  std::vector<double> Evaluate(const std::vector<Sized>& sized, const std::vector<int>& hypotheses) const {
    const Likelihood& likelihood = *experiment_.likelihood;
    std::vector<std::vector<Eigen::MatrixXd>> grams(
        sized.size(), std::vector<Eigen::MatrixXd>(likelihood.hypotheses().size()));
    const auto gram = [&](int begin, int end) {
      for (int h = begin; h < end; ++h) {
        const ScoringGram all(likelihood.GramByGroup(columns_, inner_, hypotheses[h]));
        for (size_t at = 0; at < sized.size(); ++at) grams[at][hypotheses[h]] = all.Of(sized[at].members);
      }
    };
    ParallelFor(experiment_.pool, static_cast<int>(hypotheses.size()), 4, gram);
    std::vector<double> log_evidence(sized.size());
    const auto evaluate = [&](int begin, int end) {
      for (int at = begin; at < end; ++at) {
        std::vector<int> in_order(sized[at].members.size());
        std::iota(in_order.begin(), in_order.end(), 0);
        log_evidence[at] =
            ComputeLaplaceEvidence(likelihood, grams[at], in_order, sized[at].parameters, sized[at].point)
                .log_evidence;
      }
    };
    ParallelFor(experiment_.pool, static_cast<int>(sized.size()), 1, evaluate);
    return log_evidence;
  }

  const Experiment& experiment_;
  const Fit& fit_;
  const int own_;
  std::vector<Extension>& extensions_;
  Eigen::MatrixXd wide_;
  std::vector<int> first_column_;       // of wide_, per extension
  Likelihood::Columns columns_;         // of the fit, then wide_
  std::vector<Eigen::MatrixXd> inner_;  // of columns_, by group
};

}  // namespace

void StepwiseSearch::Extend(const Extension& extension, Parameterization* model) const {
  if (extension.candidate < 0) {
    model->Free(extension.given, true);
    return;
  }
  const Candidate& candidate = candidates_[extension.candidate];
  if (extension.object.empty())
    model->Add(candidate.effect, candidate.per_object);
  else
    model->AddOn(candidate.effect, extension.object);
  const std::vector<double>& values = candidate.starts_at;
  if (values.empty()) return;
  Eigen::VectorXd point = model->Start();
  point.tail(static_cast<int>(values.size())) =
      Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<int>(values.size()));
  model->MoveTo(point);
}

// What may extend the fit: effects of the model whose values are not free yet, and candidates that it lacks.
std::vector<Extension> StepwiseSearch::ListExtensions(const Fit& fit, int initial_effects) const {
  std::vector<Extension> extensions;
  const model::Model& model = fit.model.base();
  for (int index = 0; index < initial_effects; ++index) {
    const model::Effect& own = *model.effects[index].effect;
    if (fit.model.IsFree(index) || own.random() || own.parameters.empty()) continue;
    const std::vector<std::string>& settled = experiment_.settled;
    if (std::find(settled.begin(), settled.end(), own.name) != settled.end()) continue;
    Extension extension;
    extension.name = NameOf(*model.effects[index].effect);
    extension.given = index;
    extension.start = fit.model;
    Extend(extension, &extension.start);
    extensions.push_back(std::move(extension));
  }
  for (int c = 0; c < static_cast<int>(candidates_.size()); ++c) {
    const std::string name = NameOf(*candidates_[c].effect);
    const bool present =
        std::any_of(model.effects.begin(), model.effects.end(),
                    [&](const model::EffectInstance& e) { return NameOf(*e.effect) == name; });
    if (present) continue;
    Extension extension;
    extension.candidate = c;
    extension.name = name;
    extension.object = candidates_[c].object;
    extension.rare = candidates_[c].rare;
    extension.nameless = candidates_[c].nameless;
    extension.start = fit.model;
    Extend(extension, &extension.start);
    extensions.push_back(std::move(extension));
  }
  return extensions;
}

absl::StatusOr<std::vector<Extension>> StepwiseSearch::Score(const Fit& fit, int initial_effects,
                                                             std::vector<PairOfExtensions>* pairs) const {
  std::vector<Extension> extensions = ListExtensions(fit, initial_effects);
  Scorer scorer(experiment_, fit, &extensions);
  TOUCHSTONE_RETURN_IF_ERROR(scorer.Run());
  if (pairs != nullptr) *pairs = scorer.Pairs();
  TOUCHSTONE_RETURN_IF_ERROR(ScoreOnGrid(experiment_, fit, &extensions));
  return extensions;
}

}  // namespace touchstone::diagnosis::engine
