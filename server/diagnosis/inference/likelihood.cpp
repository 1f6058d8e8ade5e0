#include "server/diagnosis/inference/likelihood.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <array>
#include <cmath>

namespace touchstone {
namespace {

// Correlation lengths over the longest side of the object, and bump sizes over sigma (as contact time).
constexpr double kLengths[] = {0.04, 0.07, 0.12, 0.2, 0.35};
constexpr double kRatios[] = {0.08, 0.12, 0.18, 0.27, 0.4, 0.6, 0.9, 1.35, 2, 3, 5, 8, 15, 30};
constexpr double kMinCosine = 0.1;
constexpr int kMaxPoints = 160;
constexpr int kMaxWithInner = 128;  // columns

double Matern52(double distance, double length) {
  const double x = std::sqrt(5.0) * distance / length;
  return (1 + x + x * x / 3) * std::exp(-x);
}

// Points that stand for all: every one if there are few, else far from one another (greedy).
std::vector<Eigen::Vector3d> Inducing(const std::vector<Eigen::Vector3d>& points) {
  if (static_cast<int>(points.size()) <= kMaxPoints) return points;
  std::vector<Eigen::Vector3d> chosen = {points[0]};
  std::vector<double> nearest(points.size(), INFINITY);
  while (static_cast<int>(chosen.size()) < kMaxPoints) {
    size_t farthest = 0;
    for (size_t k = 0; k < points.size(); ++k) {
      nearest[k] = std::min(nearest[k], (points[k] - chosen.back()).squaredNorm());
      if (nearest[k] > nearest[farthest]) farthest = k;
    }
    if (nearest[farthest] <= 0) break;
    chosen.push_back(points[farthest]);
  }
  return chosen;
}

}  // namespace

Likelihood::Likelihood(const Observations& o, const Contrasts& contrasts, const Prediction& details,
                       bool field, double floor_s, ThreadPool* pool)
    : rows_(contrasts.rows()), floor_s_(floor_s) {
  const int objects = static_cast<int>(o.objects.size());
  for (int object = 0; object <= objects; ++object) object_row_.push_back(contrasts.FirstRowOfObject(object));
  surfaces_.push_back({});
  if (!field || rows_ == 0) return;

  // Contacts of each object, once a pose and finger.
  double mean_slope = 0;
  int counted = 0;
  std::vector<std::vector<Eigen::Vector3d>> points(objects);
  std::vector<char> seen(o.poses, 0);
  for (size_t t = 0; t < contrasts.touches().size(); ++t) {
    const int k = contrasts.touches()[t];
    for (int i = 0; i < o.fingers; ++i) {
      if (!contrasts.TakesPart(static_cast<int>(t), i)) continue;
      mean_slope += details.slope_s_m[static_cast<size_t>(k) * o.fingers + i];
      ++counted;
      if (!seen[o.pose[k]])
        points[o.object[k]].push_back(details.contact_m[static_cast<size_t>(k) * o.fingers + i]);
    }
    seen[o.pose[k]] = 1;
  }
  mean_slope /= counted;

  // For every length and object: features of the field at the contacts, as contrasts, turned so that they are
  // orthogonal.
  const int lengths = static_cast<int>(std::size(kLengths));
  std::vector<double> length_m(lengths);
  double side_m = 0;
  for (const auto& surface : o.surfaces)
    side_m += (surface->bounds().max_m - surface->bounds().min_m).maxCoeff() / objects;
  for (int l = 0; l < lengths; ++l) length_m[l] = kLengths[l] * side_m;
  bases_.resize(lengths);
  for (Basis& basis : bases_) basis.directions.resize(objects);
  std::vector<std::vector<Eigen::VectorXd>> energies(lengths, std::vector<Eigen::VectorXd>(objects));
  const auto make = [&](int begin, int end) {
    for (int task = begin; task < end; ++task) {
      const int l = task / objects, object = task % objects;
      const int first = object_row_[object], rows = object_row_[object + 1] - first;
      if (rows == 0) {
        energies[l][object].resize(0);
        bases_[l].directions[object].resize(0, 0);
        continue;
      }
      const std::vector<Eigen::Vector3d> inducing = Inducing(points[object]);
      const int m = static_cast<int>(inducing.size());
      Eigen::MatrixXd kernel(m, m);
      for (int a = 0; a < m; ++a)
        for (int b = 0; b <= a; ++b)
          kernel(a, b) = kernel(b, a) = Matern52((inducing[a] - inducing[b]).norm(), length_m[l]);
      kernel.diagonal().array() += 1e-6;
      const Eigen::LLT<Eigen::MatrixXd> cholesky(kernel);
      Eigen::MatrixXd raw = Eigen::MatrixXd::Zero(rows, m);
      Eigen::VectorXd feature(m);
      for (int row = first; row < first + rows;) {
        const int t = contrasts.touch_of_row()[row];
        const int k = contrasts.touches()[t];
        const Eigen::MatrixXd& h = contrasts.MatrixOf(t);
        for (int i = 0; i < o.fingers; ++i) {
          if (!contrasts.TakesPart(t, i)) continue;
          const size_t entry = static_cast<size_t>(k) * o.fingers + i;
          const double gain = -details.slope_s_m[entry] / std::max(details.cos_incidence[entry], kMinCosine);
          for (int a = 0; a < m; ++a)
            feature[a] = Matern52((details.contact_m[entry] - inducing[a]).norm(), length_m[l]);
          for (int j = 0; j < h.rows(); ++j)
            raw.row(row - first + j) += (contrasts.root_weights()[t] * gain * h(j, i)) * feature.transpose();
        }
        row += static_cast<int>(h.rows());
      }
      // raw L^-T: features of unit variance.
      const Eigen::MatrixXd z = cholesky.matrixL().solve(raw.transpose()).transpose();
      const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(z.transpose() * z);
      const double least = 1e-7 * std::max(eigen.eigenvalues().maxCoeff(), 1e-300);
      int kept = 0;
      for (int a = 0; a < m; ++a) kept += eigen.eigenvalues()[a] > least;
      bases_[l].directions[object] = z * eigen.eigenvectors().rightCols(kept);
      energies[l][object] = eigen.eigenvalues().tail(kept);
    }
  };
  ParallelFor(pool, lengths * objects, 1, make);

  for (int l = 0; l < lengths; ++l) {
    Eigen::VectorXd& all = bases_[l].energies;
    for (const Eigen::VectorXd& part : energies[l]) {
      all.conservativeResize(all.size() + part.size());
      all.tail(part.size()) = part;
    }
    for (const double ratio : kRatios) {
      Surface surface;
      surface.length_m = length_m[l];
      surface.length_index = l;
      surface.ratio_m_s = ratio / mean_slope;
      const double square = surface.ratio_m_s * surface.ratio_m_s;
      surface.log_determinant = (1 + square * all.array()).log().sum();
      surface.degrees = (square * all.array() / (1 + square * all.array())).sum();
      surfaces_.push_back(surface);
    }
  }
}

Likelihood::Columns Likelihood::Prepare(const Eigen::MatrixXd& values) const {
  Columns columns{values, {}, {}};
  if (values.cols() <= kMaxWithInner) columns.inner = values.transpose() * values;
  for (const Basis& basis : bases_) {
    Eigen::MatrixXd projected(basis.energies.size(), values.cols());
    int next = 0;
    for (size_t object = 0; object < basis.directions.size(); ++object) {
      const Eigen::MatrixXd& directions = basis.directions[object];
      if (directions.cols() == 0) continue;
      projected.middleRows(next, directions.cols()).noalias() =
          directions.transpose() * values.middleRows(object_row_[object], directions.rows());
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
  if (all.values.cols() <= kMaxWithInner) all.inner = all.values.transpose() * all.values;
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
  const double square = surfaces_[s].ratio_m_s * surfaces_[s].ratio_m_s;
  const Eigen::VectorXd& energies = bases_[surfaces_[s].length_index].energies;
  return (square / (1 + square * energies.array())).matrix();
}

Eigen::MatrixXd Likelihood::Cross(const Columns& a, const Columns& b, int s) const {
  Eigen::MatrixXd cross = a.values.transpose() * b.values;
  const int l = surfaces_[s].length_index;
  if (l >= 0) cross.noalias() -= a.projected[l].transpose() * (Shrinkage(s).asDiagonal() * b.projected[l]);
  return cross;
}

Eigen::MatrixXd Likelihood::Gram(const Columns& columns, int s) const {
  if (columns.inner.size() == 0) return Cross(columns, columns, s);
  Eigen::MatrixXd gram = columns.inner;
  const int l = surfaces_[s].length_index;
  if (l >= 0)
    gram.noalias() -= columns.projected[l].transpose() * (Shrinkage(s).asDiagonal() * columns.projected[l]);
  return gram;
}

Eigen::VectorXd Likelihood::Norms(const Columns& columns, int s) const {
  Eigen::VectorXd norms = columns.values.colwise().squaredNorm().transpose();
  const int l = surfaces_[s].length_index;
  if (l >= 0)
    norms -= (columns.projected[l].array().square().colwise() * Shrinkage(s).array())
                 .colwise()
                 .sum()
                 .matrix()
                 .transpose();
  return norms;
}

double Likelihood::LogLikelihood(double q, int s) const {
  const double n = rows_;
  return -0.5 * n * std::log(std::max(q, 0.0) / n + floor_s_ * floor_s_) - 0.5 * surfaces_[s].log_determinant;
}

double Likelihood::Sigma(double q, int parameters) const {
  return std::sqrt(std::max(q, 0.0) / std::max(rows_ - parameters, 1) + floor_s_ * floor_s_);
}

double Likelihood::LogPrior(int s) const {
  const int others = static_cast<int>(surfaces_.size()) - 1;
  if (others == 0) return 0;
  return s == 0 ? std::log(0.5) : std::log(0.5 / others);
}

Eigen::VectorXd Likelihood::FieldMean(const Columns& r, int s) const {
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(rows_);
  const int l = surfaces_[s].length_index;
  if (l < 0) return mean;
  const Eigen::VectorXd weights = Shrinkage(s).cwiseProduct(r.projected[l].col(0));
  int next = 0;
  for (size_t object = 0; object < bases_[l].directions.size(); ++object) {
    const Eigen::MatrixXd& directions = bases_[l].directions[object];
    if (directions.cols() == 0) continue;
    mean.segment(object_row_[object], directions.rows()) =
        directions * weights.segment(next, directions.cols());
    next += static_cast<int>(directions.cols());
  }
  return mean;
}

}  // namespace touchstone
