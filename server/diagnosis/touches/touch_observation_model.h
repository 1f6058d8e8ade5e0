// A set of touches as the engine sees it: contrasts as rows, objects as groups, poses as blocks.
#pragma once

#include <string>
#include <vector>

#include "server/diagnosis/engine/fit/observation_model.h"
#include "server/diagnosis/engine/fit/smooth_error.h"
#include "server/diagnosis/touches/contrasts.h"
#include "server/diagnosis/touches/prediction.h"
#include "server/diagnosis/touches/predictor.h"

namespace touchstone::diagnosis::touches {

class TouchObservationModel : public engine::ObservationModel {
 public:
  // All must outlive it. `nominal_s`: the given model's times, which stand in where another model misses.
  TouchObservationModel(const Observations& observations, const Predictor& predictor,
                        const Contrasts& contrasts, std::vector<double> nominal_s)
      : observations_(observations),
        predictor_(predictor),
        contrasts_(contrasts),
        nominal_s_(std::move(nominal_s)) {}

  int rows() const override { return contrasts_.rows(); }
  const std::vector<std::string>& groups() const override { return observations_.objects; }
  int FirstRowOfGroup(int group) const override { return contrasts_.FirstRowOfObject(group); }
  int GroupOfRow(int row) const override { return observations_.object[TouchOfRow(row)]; }
  int BlockOfRow(int row) const override { return observations_.pose[TouchOfRow(row)]; }
  double TimeOfRow(int row) const override;

  // Reported times, s, [k * fingers + finger].
  absl::StatusOr<std::vector<double>> Predict(const model::Model& model) const override;
  Eigen::VectorXd Residual(const std::vector<double>& predicted_s) const override;
  Eigen::VectorXd Change(const std::vector<double>& predicted_s,
                         const std::vector<double>& moved_s) const override;

  const Observations& observations() const { return observations_; }
  const Predictor& predictor() const { return predictor_; }
  const Contrasts& contrasts() const { return contrasts_; }

 private:
  int TouchOfRow(int row) const { return contrasts_.touches()[contrasts_.touch_of_row()[row]]; }

  const Observations& observations_;
  const Predictor& predictor_;
  const Contrasts& contrasts_;
  std::vector<double> nominal_s_;
};

// The first row of each object, then the number of rows.
std::vector<int> FirstRowsOfObjects(const Contrasts& contrasts, int objects);

// How bumps of the objects' surfaces change the contrasts: a bump h along the normal shortens the travel by
// h / cos(incidence). `details`: of the nominal model, which says where the contacts are.
engine::SmoothErrorGeometry SurfaceErrorGeometry(const Observations& observations, const Contrasts& contrasts,
                                                 const Prediction& details);

}  // namespace touchstone::diagnosis::touches
