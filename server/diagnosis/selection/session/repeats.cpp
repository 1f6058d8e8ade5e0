#include "server/diagnosis/selection/session/repeats.h"

#include <map>
#include <utility>

namespace touchstone::diagnosis::selection {

Repeats::Repeats(const touches::Observations& o, const touches::Contrasts& contrasts)
    : contrasts_(contrasts) {
  const int touches = static_cast<int>(contrasts.touches().size());
  std::map<std::pair<int, int>, std::vector<int>> cells;  // by pose and fingers
  for (int t = 0; t < touches; ++t) {
    int fingers = 0;
    for (int i = 0; i < o.fingers; ++i) fingers |= contrasts.TakesPart(t, i) << i;
    cells[{o.pose[contrasts.touches()[t]], fingers}].push_back(t);
  }
  for (auto& [key, members] : cells) {
    if (members.size() < 2) continue;
    degrees_ += static_cast<double>((members.size() - 1) * RowsOf(members[0]));
    cells_.push_back(std::move(members));
  }
}

Eigen::MatrixXd Repeats::Centred(const Eigen::MatrixXd& rows) const {
  Eigen::MatrixXd centred = Eigen::MatrixXd::Zero(rows.rows(), rows.cols());
  for (const std::vector<int>& cell : cells_) {
    const int height = RowsOf(cell[0]);
    Eigen::MatrixXd mean = Eigen::MatrixXd::Zero(height, rows.cols());
    for (const int t : cell) mean += rows.middleRows(contrasts_.FirstRow(t), height) / cell.size();
    for (const int t : cell)
      centred.middleRows(contrasts_.FirstRow(t), height) =
          rows.middleRows(contrasts_.FirstRow(t), height) - mean;
  }
  return centred;
}

double Repeats::DegreesTaken(const Eigen::MatrixXd& columns) const {
  const Eigen::MatrixXd centred = Centred(columns);
  double taken = 0;
  for (Eigen::Index i = 0; i < columns.cols(); ++i)
    if (const double squares = columns.col(i).squaredNorm(); squares > 0)
      taken += centred.col(i).squaredNorm() / squares;
  return taken;
}

Eigen::MatrixXd Repeats::Only(const Eigen::MatrixXd& rows, const std::vector<char>& has) const {
  Eigen::MatrixXd only = Eigen::MatrixXd::Zero(rows.rows(), rows.cols());
  for (int t = 0; t < static_cast<int>(has.size()); ++t)
    if (has[t])
      only.middleRows(contrasts_.FirstRow(t), RowsOf(t)) = rows.middleRows(contrasts_.FirstRow(t), RowsOf(t));
  return only;
}

Eigen::VectorXd Repeats::Shuffled(const Eigen::VectorXd& rows, RandomStream* random) const {
  Eigen::VectorXd shuffled = rows;
  for (const std::vector<int>& cell : cells_) {
    std::vector<int> from = cell;
    for (size_t left = from.size(); left > 1; --left) std::swap(from[left - 1], from[random->Below(left)]);
    for (size_t m = 0; m < cell.size(); ++m)
      shuffled.segment(contrasts_.FirstRow(cell[m]), RowsOf(cell[0])) =
          rows.segment(contrasts_.FirstRow(from[m]), RowsOf(cell[0]));
  }
  return shuffled;
}

}  // namespace touchstone::diagnosis::selection
