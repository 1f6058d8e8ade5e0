// A model with some of its values free, as a point in R^n that a fit can move.
#pragma once

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "server/diagnosis/engine/fit/parameter_estimate.h"
#include "server/model/model.h"
#include "server/model/value_names.h"

namespace touchstone::diagnosis::engine {

// One direction in which values may move.
struct FreeParameter {
  int effect = 0;               // index into the model's effects
  int parameter = 0;            // of that effect
  std::string object;           // whose value; empty: every object's
  std::vector<double> weights;  // change of the effect's flat values (SI) per unit of this one
  double lower = 0, upper = 0;  // of this one
  double usual_lower = -INFINITY,
         usual_upper = INFINITY;  // what rigs show: beyond it a value needs strong evidence
  double scale = 1;               // size that rigs show: unit of steps and width of the prior
  double neutral = 0;             // the value that changes nothing, or that the model had
  bool reciprocal = false;        // the value is 1 / this one (ParameterInfo::reciprocal)
  int shape = 0;                  // parameters of one shape differ by object only
  double log_prior = 0;           // nats, whatever the value: of the choice of one object among many
};

class Parameterization {
 public:
  Parameterization() = default;
  // Nothing is free yet; values of per-object effects are spelled out for `objects`.
  Parameterization(model::Model base, std::vector<std::string> objects);

  // Sets every value of effect `index` free. Values that start where a sum of zero binds them stay bound.
  // `refit`: the model had the effect; the prior is around its values.
  void Free(int index, bool refit);
  // Appends an effect at values that change nothing (or, for formulas, at those given) and sets it free.
  void Add(std::shared_ptr<const model::Effect> effect, bool per_object);
  // The same on one object only: on all others the effect changes nothing, and the choice among them is paid for.
  void AddOn(std::shared_ptr<const model::Effect> effect, const std::string& object);
  // The one object among several on which effect `index` acts; empty: it has a value for each.
  std::string OnlyObject(int index) const;
  // The effect keeps its values and is no longer free.
  void Hold(int index);
  // Takes effect `index` out, with its free parameters.
  Parameterization Without(int index) const;

  const model::Model& base() const { return base_; }
  const std::vector<FreeParameter>& parameters() const { return parameters_; }
  int size() const { return static_cast<int>(parameters_.size()); }
  bool IsFree(int effect) const;

  // The point where the base stands.
  Eigen::VectorXd Start() const;
  // The model at a point; values are clipped to their bounds.
  model::Model At(const Eigen::VectorXd& point) const;
  // The same as a new base: fits continue from there.
  void MoveTo(const Eigen::VectorXd& point);
  Eigen::VectorXd Clip(Eigen::VectorXd point) const;

  // Values and errors of effect `index` at a point, in the units of files. `covariance` of the free parameters.
  std::vector<ParameterEstimate> Describe(int index, const Eigen::VectorXd& point,
                                          const Eigen::MatrixXd& covariance) const;

 private:
  model::Model base_;
  std::vector<std::string> objects_;
  std::vector<FreeParameter> parameters_;
  int shapes_ = 0;
};

using model::EntryName;
using model::NameOf;

}  // namespace touchstone::diagnosis::engine
