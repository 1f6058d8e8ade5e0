#include "server/diagnosis/engine/search/grid_scores.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "server/base/status.h"
#include "server/diagnosis/engine/search/rules.h"
#include "server/diagnosis/engine/search/size_grid.h"

namespace touchstone::diagnosis::engine {
namespace {

class GridScorer {
 public:
  GridScorer(const Experiment& experiment, const Fit& fit, std::vector<Extension>* extensions)
      : experiment_(experiment), fit_(fit), own_(fit.model.size()), extensions_(*extensions) {}

  // Sizes of those that show nothing near the start, or whose response is declared to be a line in another measure only.
  absl::Status Run() {
    std::vector<int> dark;
    for (int m = 0; m < static_cast<int>(extensions_.size()); ++m)
      if (HasNoSlope(extensions_[m])) dark.push_back(m);
    for (const bool together : {false, true}) {
      std::vector<OnGrid> tries;
      for (const int m : dark)
        if (!extensions_[m].acts_at && (!together || extensions_[m].start.size() > own_ + 1))
          AddSizes(m, together, &tries);
      TOUCHSTONE_RETURN_IF_ERROR(EvaluateEach(&tries));
      for (const OnGrid& tried : tries) {
        Extension& extension = extensions_[tried.extension];
        if (!tried.moves || (extension.acts_at && tried.log_evidence <= best_on_grid_[tried.extension]))
          continue;
        best_on_grid_[tried.extension] = tried.log_evidence;
        extension.acts_at = extension.start;
        extension.acts_at->MoveTo(tried.point);
      }
    }
    for (const auto& [m, log_evidence] : best_on_grid_)
      if (!extensions_[m].visible || log_evidence > extensions_[m].log_evidence)
        extensions_[m].log_evidence = log_evidence;
    return absl::OkStatus();
  }

 private:
  // One size of one value, the extension's others as they are at the start or (`together`) at what rigs show.
  struct OnGrid {
    int extension = 0;
    Eigen::VectorXd point;
    int value = 0;  // index of the parameter
    bool moves = false;
    double log_evidence = -INFINITY;
  };

  bool HasNoSlope(const Extension& extension) const {
    if (extension.candidate < 0 || extension.rare || extension.nameless || extension.start.size() <= own_)
      return false;
    return !extension.visible || extension.start.parameters().back().reciprocal;
  }

  void AddSizes(int m, bool together, std::vector<OnGrid>* tries) const {
    const Parameterization& start = extensions_[m].start;
    Eigen::VectorXd at_typical = start.Start();
    double sign = 1;
    for (int i = own_; together && i < start.size(); ++i) {
      const FreeParameter& p = start.parameters()[i];
      const double reach = Reach(p, &sign);
      at_typical[i] = p.neutral + sign * std::min(p.scale, reach);
    }
    for (int i = own_; i < start.size(); ++i) {
      const FreeParameter& p = start.parameters()[i];
      Reach(p, &sign);
      for (const double size : SizesOnGrid(p)) {
        OnGrid tried = {m, at_typical, i};
        tried.point[i] = p.neutral + sign * size;
        tries->push_back(std::move(tried));
      }
    }
  }

  // One simulation each; the line from the start to there stands for the slope.
  absl::Status EvaluateEach(std::vector<OnGrid>* tries) const {
    std::vector<absl::Status> statuses(tries->size());
    ParallelFor(experiment_.pool, static_cast<int>(tries->size()), 1, [&](int begin, int end) {
      for (int at = begin; at < end; ++at) {
        if (experiment_.cancelled && experiment_.cancelled()) continue;
        statuses[at] = EvaluateSize(&(*tries)[at]);
      }
    });
    for (const absl::Status& status : statuses) TOUCHSTONE_RETURN_IF_ERROR(status);
    if (experiment_.cancelled && experiment_.cancelled())
      return absl::CancelledError("the diagnosis was cancelled");
    return absl::OkStatus();
  }

  absl::Status EvaluateSize(OnGrid* tried) const {
    const Parameterization& start = extensions_[tried->extension].start;
    const FreeParameter& parameter = start.parameters()[tried->value];
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<double> predicted,
                                experiment_.observations->Predict(start.At(tried->point)));
    const Eigen::VectorXd response = experiment_.observations->Change(fit_.predicted, predicted);
    tried->moves =
        response.norm() > kCandidateRules.visible_change * std::sqrt(static_cast<double>(response.size()));
    if (!tried->moves) return absl::OkStatus();
    Eigen::MatrixXd values(response.size(), own_ + 2);
    values << experiment_.observations->Residual(predicted), fit_.columns.values.middleCols(1, own_),
        response / (tried->point[tried->value] - parameter.neutral);
    std::vector<FreeParameter> parameters(start.parameters().begin(), start.parameters().begin() + own_);
    parameters.push_back(parameter);
    Eigen::VectorXd point(own_ + 1);
    point << tried->point.head(own_), tried->point[tried->value];
    std::vector<int> in_order(own_ + 2);
    std::iota(in_order.begin(), in_order.end(), 0);
    const Likelihood& likelihood = *experiment_.likelihood;
    tried->log_evidence = ComputeLaplaceEvidence(likelihood, Grams(likelihood, likelihood.Prepare(values)),
                                                 in_order, parameters, point)
                              .log_evidence;
    return absl::OkStatus();
  }

  const Experiment& experiment_;
  const Fit& fit_;
  const int own_;
  std::vector<Extension>& extensions_;
  std::map<int, double> best_on_grid_;  // log evidence, by extension
};

}  // namespace

absl::StatusOr<Eigen::MatrixXd> ResponseColumns(const Experiment& experiment, const Extension& extension,
                                                const Fit& fit) {
  if (extension.visible || !extension.acts_at)
    return Derivatives(experiment, extension.start, extension.start.Start(), fit.predicted, fit.model.size());
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<double> there,
                              experiment.observations->Predict(extension.acts_at->base()));
  return Eigen::MatrixXd(experiment.observations->Change(fit.predicted, there));
}

absl::Status ScoreOnGrid(const Experiment& experiment, const Fit& fit, std::vector<Extension>* extensions) {
  return GridScorer(experiment, fit, extensions).Run();
}

}  // namespace touchstone::diagnosis::engine
