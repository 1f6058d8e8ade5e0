#include "server/diagnosis/engine/fit/likelihood.h"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>

#include "server/base/numbers/decompositions.h"
#include "server/base/numbers/matern.h"
#include "server/diagnosis/engine/fit/rules.h"
#include "server/diagnosis/engine/fit/support_points.h"

namespace touchstone::diagnosis::engine {
namespace {

// Correlation lengths over the longest side of the object, and bump sizes (as rows) over sigma.
constexpr double kLengths[] = {0.04, 0.07, 0.12, 0.2, 0.35};
constexpr double kRatios[] = {0.08, 0.12, 0.18, 0.27, 0.4, 0.6, 0.9, 1.35, 2, 3, 5, 8, 15, 30};

// Features of the field at a group's rows, turned so that they are orthogonal; `energies`: their squared norms.
Eigen::MatrixXd OrthogonalFeatures(const std::vector<SmoothErrorSite>& sites,
                                   const std::vector<Eigen::Vector3d>& inducing, double length_m,
                                   int first_row, int rows, Eigen::VectorXd* energies) {
  const int m = static_cast<int>(inducing.size());
  Eigen::MatrixXd kernel(m, m);
  for (int a = 0; a < m; ++a)
    for (int b = 0; b <= a; ++b)
      kernel(a, b) = kernel(b, a) = Matern52((inducing[a] - inducing[b]).norm(), length_m);
  kernel.diagonal().array() += 1e-6;
  const Eigen::LLT<Eigen::MatrixXd> cholesky(kernel);
  Eigen::MatrixXd raw = Eigen::MatrixXd::Zero(rows, m);
  Eigen::VectorXd feature(m);
  for (const SmoothErrorSite& site : sites) {
    for (int a = 0; a < m; ++a) feature[a] = Matern52((site.position_m - inducing[a]).norm(), length_m);
    for (size_t j = 0; j < site.row_per_m.size(); ++j)
      raw.row(site.first_row - first_row + static_cast<int>(j)) += site.row_per_m[j] * feature.transpose();
  }
  // raw L^-T: features of unit variance.
  const Eigen::MatrixXd z = cholesky.matrixL().solve(raw.transpose()).transpose();
  const SymmetricEigen eigen = EigenOfSymmetric(z.transpose() * z);
  const double min_energy = 1e-7 * std::max(eigen.values.maxCoeff(), 1e-300);
  int kept = 0;
  for (int a = 0; a < m; ++a) kept += eigen.values[a] > min_energy;
  *energies = eigen.values.tail(kept);
  return z * eigen.vectors.rightCols(kept);
}

}  // namespace

Likelihood::Likelihood(std::vector<int> group_rows, const SmoothErrorGeometry* geometry, double floor,
                       ThreadPool* pool)
    : group_rows_(std::move(group_rows)), floor_(floor) {
  hypotheses_.push_back({});
  if (geometry == nullptr || rows() == 0) return;
  std::vector<double> length_m;
  for (const double length : kLengths) length_m.push_back(length * geometry->size_m);
  MakeBases(*geometry, length_m, pool);
  for (size_t l = 0; l < length_m.size(); ++l) {
    const Eigen::VectorXd& energies = bases_[l].energies;
    for (const double ratio : kRatios) {
      SurfaceErrorHypothesis hypothesis;
      hypothesis.length_m = length_m[l];
      hypothesis.length_index = static_cast<int>(l);
      hypothesis.amplitude_over_sigma = ratio / geometry->mean_row_per_m;
      const double square = hypothesis.amplitude_over_sigma * hypothesis.amplitude_over_sigma;
      hypothesis.log_determinant = (1 + square * energies.array()).log().sum();
      hypothesis.effective_dof = (square * energies.array() / (1 + square * energies.array())).sum();
      hypotheses_.push_back(hypothesis);
    }
  }
}

void Likelihood::MakeBases(const SmoothErrorGeometry& geometry, const std::vector<double>& length_m,
                           ThreadPool* pool) {
  const int groups = static_cast<int>(group_rows_.size()) - 1, lengths = static_cast<int>(length_m.size());
  bases_.resize(lengths);
  for (Basis& basis : bases_) basis.directions.resize(groups);
  std::vector<std::vector<Eigen::VectorXd>> energies(lengths, std::vector<Eigen::VectorXd>(groups));
  const auto make = [&](int begin, int end) {
    for (int task = begin; task < end; ++task) {
      const int l = task / groups, group = task % groups;
      const int first = group_rows_[group], rows = group_rows_[group + 1] - first;
      if (rows == 0) continue;
      bases_[l].directions[group] = OrthogonalFeatures(
          geometry.sites[group], SupportPoints(geometry.distinct_m[group], kFitRules.max_support_points),
          length_m[l], first, rows, &energies[l][group]);
    }
  };
  ParallelFor(pool, lengths * groups, 1, make);
  for (int l = 0; l < lengths; ++l) {
    Eigen::VectorXd& all = bases_[l].energies;
    for (const Eigen::VectorXd& part : energies[l]) {
      all.conservativeResize(all.size() + part.size());
      all.tail(part.size()) = part;
    }
  }
}

Likelihood::Columns Likelihood::Prepare(const Eigen::MatrixXd& values) const {
  Columns columns{values, {}, {}};
  if (values.cols() <= kFitRules.max_columns_with_inner) columns.inner = values.transpose() * values;
  for (const Basis& basis : bases_) {
    Eigen::MatrixXd projected(basis.energies.size(), values.cols());
    int next = 0;
    for (size_t group = 0; group < basis.directions.size(); ++group) {
      const Eigen::MatrixXd& directions = basis.directions[group];
      if (directions.cols() == 0) continue;
      projected.middleRows(next, directions.cols()).noalias() =
          directions.transpose() * values.middleRows(group_rows_[group], directions.rows());
      next += static_cast<int>(directions.cols());
    }
    columns.projected.push_back(std::move(projected));
  }
  return columns;
}

Likelihood::Columns Likelihood::Join(const Columns& a, const Columns& b) {
  Columns all;
  all.values.resize(a.values.rows(), a.values.cols() + b.values.cols());
  all.values << a.values, b.values;
  for (size_t l = 0; l < a.projected.size(); ++l) {
    Eigen::MatrixXd joined(a.projected[l].rows(), all.values.cols());
    joined << a.projected[l], b.projected[l];
    all.projected.push_back(std::move(joined));
  }
  if (all.values.cols() <= kFitRules.max_columns_with_inner) all.inner = all.values.transpose() * all.values;
  return all;
}

Likelihood::Columns Likelihood::Pick(const Columns& all, const std::vector<int>& columns) {
  const auto pick = [&](const Eigen::MatrixXd& from) {
    Eigen::MatrixXd to(from.rows(), columns.size());
    for (size_t c = 0; c < columns.size(); ++c) to.col(c) = from.col(columns[c]);
    return to;
  };
  Columns picked{pick(all.values), {}, {}};
  if (all.inner.size() > 0) {
    picked.inner.resize(columns.size(), columns.size());
    for (size_t a = 0; a < columns.size(); ++a)
      for (size_t b = 0; b < columns.size(); ++b) picked.inner(a, b) = all.inner(columns[a], columns[b]);
  }
  for (const Eigen::MatrixXd& projected : all.projected) picked.projected.push_back(pick(projected));
  return picked;
}

Eigen::VectorXd Likelihood::Shrinkage(int s) const {
  const double square = hypotheses_[s].amplitude_over_sigma * hypotheses_[s].amplitude_over_sigma;
  const Eigen::VectorXd& energies = bases_[hypotheses_[s].length_index].energies;
  return (square / (1 + square * energies.array())).matrix();
}

Eigen::MatrixXd Likelihood::Cross(const Columns& a, const Columns& b, int s) const {
  Eigen::MatrixXd cross = a.values.transpose() * b.values;
  const int l = hypotheses_[s].length_index;
  if (l >= 0) cross.noalias() -= a.projected[l].transpose() * (Shrinkage(s).asDiagonal() * b.projected[l]);
  return cross;
}

Eigen::MatrixXd Likelihood::Gram(const Columns& columns, int s) const {
  if (columns.inner.size() == 0) return Cross(columns, columns, s);
  Eigen::MatrixXd gram = columns.inner;
  const int l = hypotheses_[s].length_index;
  if (l >= 0)
    gram.noalias() -= columns.projected[l].transpose() * (Shrinkage(s).asDiagonal() * columns.projected[l]);
  return gram;
}

std::vector<Eigen::MatrixXd> Likelihood::InnerByGroup(const Columns& columns) const {
  std::vector<Eigen::MatrixXd> inner;
  for (size_t group = 0; group + 1 < group_rows_.size(); ++group) {
    const auto rows =
        columns.values.middleRows(group_rows_[group], group_rows_[group + 1] - group_rows_[group]);
    inner.push_back(rows.transpose() * rows);
  }
  return inner;
}

std::vector<Eigen::MatrixXd> Likelihood::GramByGroup(const Columns& columns,
                                                     const std::vector<Eigen::MatrixXd>& inner, int s) const {
  std::vector<Eigen::MatrixXd> grams = inner;
  const int l = hypotheses_[s].length_index;
  if (l < 0) return grams;
  const Eigen::VectorXd shrinkage = Shrinkage(s);
  int next = 0;
  for (size_t group = 0; group < grams.size(); ++group) {
    const int size = static_cast<int>(bases_[l].directions[group].cols());
    const auto projected = columns.projected[l].middleRows(next, size);
    grams[group].noalias() -=
        projected.transpose() * (shrinkage.segment(next, size).asDiagonal() * projected);
    next += size;
  }
  return grams;
}

Eigen::VectorXd Likelihood::Norms(const Columns& columns, int s) const {
  Eigen::VectorXd norms = columns.values.colwise().squaredNorm().transpose();
  const int l = hypotheses_[s].length_index;
  if (l >= 0)
    norms -= (columns.projected[l].array().square().colwise() * Shrinkage(s).array())
                 .colwise()
                 .sum()
                 .matrix()
                 .transpose();
  return norms;
}

double Likelihood::LogLikelihood(double q, int s) const {
  const double n = rows() - eliminated_;
  const double found = std::max(q, 0.0) / n + floor_ * floor_, least = least_sigma_ * least_sigma_;
  const double by_noise =
      found < least ? -0.5 * n * (std::log(least) + found / least - 1) : -0.5 * n * std::log(found);
  return by_noise - 0.5 * hypotheses_[s].log_determinant;
}

double Likelihood::Sigma(double q, int parameters) const {
  return std::max(
      std::sqrt(std::max(q, 0.0) / std::max(rows() - eliminated_ - parameters, 1) + floor_ * floor_),
      least_sigma_);
}

double Likelihood::LogPrior(int s) const {
  const int others = static_cast<int>(hypotheses_.size()) - 1;
  if (others == 0) return 0;
  return s == 0 ? std::log(0.5) : std::log(0.5 / others);
}

Eigen::VectorXd Likelihood::FieldMean(const Columns& r, int s) const {
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(rows());
  const int l = hypotheses_[s].length_index;
  if (l < 0) return mean;
  const Eigen::VectorXd weights = Shrinkage(s).cwiseProduct(r.projected[l].col(0));
  int next = 0;
  for (size_t group = 0; group < bases_[l].directions.size(); ++group) {
    const Eigen::MatrixXd& directions = bases_[l].directions[group];
    if (directions.cols() == 0) continue;
    mean.segment(group_rows_[group], directions.rows()) =
        directions * weights.segment(next, directions.cols());
    next += static_cast<int>(directions.cols());
  }
  return mean;
}

Eigen::MatrixXd Likelihood::FieldLeftOut(const Eigen::MatrixXd& columns, int s,
                                         const std::vector<int>& fold_of_row, int folds,
                                         std::vector<Eigen::MatrixXd>* grams) const {
  Eigen::MatrixXd expected = Eigen::MatrixXd::Zero(rows(), columns.cols());
  std::vector<Eigen::MatrixXd> own_grams(folds, columns.transpose() * columns);
  for (int row = 0; row < rows(); ++row)
    own_grams[fold_of_row[row]] -= columns.row(row).transpose() * columns.row(row);
  const int l = hypotheses_[s].length_index;
  const size_t groups = l < 0 ? 0 : bases_[l].directions.size();
  const double precision = l < 0 ? 0 : std::pow(hypotheses_[s].amplitude_over_sigma, -2);
  for (size_t group = 0; group < groups; ++group) {
    const Eigen::MatrixXd& directions = bases_[l].directions[group];
    const int first = group_rows_[group];
    if (directions.cols() == 0) continue;
    const Eigen::MatrixXd all = directions.transpose() * columns.middleRows(first, directions.rows());
    const Eigen::VectorXd energies = directions.colwise().squaredNorm().transpose();
    for (int fold = 0; fold < folds; ++fold) {
      std::vector<int> members;
      for (int row = 0; row < directions.rows(); ++row)
        if (fold_of_row[first + row] == fold) members.push_back(row);
      const int count = static_cast<int>(members.size());
      Eigen::MatrixXd left_out(count, directions.cols()), values(count, columns.cols());
      for (int m = 0; m < count; ++m) {
        left_out.row(m) = directions.row(members[m]);
        values.row(m) = columns.row(first + members[m]);
      }
      Eigen::MatrixXd rest = -left_out.transpose() * left_out;
      rest.diagonal().array() += energies.array() + precision;
      const Eigen::MatrixXd kept = all - left_out.transpose() * values;
      const Eigen::MatrixXd weights = SymmetricSolver(rest).SolveColumns(kept);
      own_grams[fold] -= kept.transpose() * weights;
      const Eigen::MatrixXd field = left_out * weights;
      for (int m = 0; m < count; ++m) expected.row(first + members[m]) = field.row(m);
    }
  }
  if (grams != nullptr) *grams = std::move(own_grams);
  return expected;
}

}  // namespace touchstone::diagnosis::engine
