// Which scatter residuals have, from plain Gaussian noise on: every further parameter must earn its likelihood.
#pragma once

#include <cmath>
#include <vector>

#include "server/diagnosis/touches/noise/noise_kinds.h"

namespace touchstone::diagnosis::touches {

class NoiseSearch {
 public:
  // The sample must outlive the search.
  NoiseSearch(const NoiseSample& sample, const DeclaredNoise& declared, NoiseFindings* found);

  // Fills sigma, slope, tails, outliers, length and channels of the findings.
  void Run();

  // The best description, its sigma from every reading.
  const NoiseModel& best() const { return best_.model; }
  // Contrasts that its parameters were found on: all, but for the shape of heavy tails.
  double shape_dof() const;

 private:
  // What the scale of a reading may depend on.
  enum Kind { kGrowth, kLength, kChannels, kKinds };
  struct Description {
    NoiseModel model;
    double log_likelihood = -INFINITY;  // on every reading; with tails: on the part
    bool has[kKinds] = {};
    double gain_nats[kKinds] = {};
    NoiseEstimate tails;  // degrees of freedom
    bool gaussian() const { return model.shape == NoiseShape::kGaussian; }
  };

  bool Declared(Kind kind) const;
  // The model's own value of one kind.
  NoiseModel AsDeclared(Kind kind) const;
  bool Possible(Kind kind) const;
  double Threshold(Kind kind) const;
  Description Fit(Kind kind, const Description& from) const;
  void FitChannels(Description* trial) const;
  // Whether repeats, which no misfit touches, scatter like that too.
  bool RepeatsAgree(const NoiseModel& with, const NoiseModel& without, double gain_nats) const;
  Description WithKinds(Description from) const;
  bool TailsLookHeavy(const NoiseModel& model) const;
  Description FitStudent(const Description& from) const;
  Description FitMixture(const Description& from) const;
  // Heavy tails or a few outliers, if they earn their parameters.
  Description WithTails(const Description& plain) const;
  double Score(const Description& description) const;
  void DropKindsThatTailsExplain();
  void JudgeDeclaredTails();
  void JudgeDeclaredScales();
  void DescribeGrowth();
  void DescribeLength();
  void DescribeChannels();
  // Every group, but for the shape of heavy tails.
  const std::vector<ReadingGroup>& GroupsOfShape() const;

  const NoiseSample& sample_;
  const DeclaredNoise& declared_;
  std::vector<ReadingGroup> part_;  // that the shape of tails is judged on
  NoiseFindings* found_;
  Description best_;
};

}  // namespace touchstone::diagnosis::touches
