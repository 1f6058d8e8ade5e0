// What only touches have: fingers, histograms, points on surfaces.
#include <cmath>

#include "server/base/units.h"
#include "server/diagnosis/report/message/write_data_report.h"

namespace touchstone::diagnosis::report {
namespace {

void WriteWorstTouch(const residuals::WorstTouch& touch, v1::TouchError* message) {
  message->set_touch(touch.touch);
  message->set_object(touch.object);
  message->set_norm(Microseconds(touch.norm_s));
  for (const double residual_s : touch.residual_s) message->add_residual(Microseconds(residual_s));
}

void WriteHistogram(const residuals::ComparedHistogram& histogram, v1::Histogram* message) {
  message->set_quantity(histogram.quantity == residuals::HistogramQuantity::kDescriptor
                            ? v1::Histogram::TOUCH_DESCRIPTOR
                            : v1::Histogram::CURVATURE_PER_M);
  message->set_object(histogram.object);
  *message->mutable_edges() = {histogram.edges.begin(), histogram.edges.end()};
  *message->mutable_measured() = {histogram.measured.begin(), histogram.measured.end()};
  *message->mutable_simulated() = {histogram.simulated.begin(), histogram.simulated.end()};
  *message->mutable_improved() = {histogram.improved.begin(), histogram.improved.end()};
  message->set_p_simulated(histogram.p_simulated);
  message->set_p_improved(histogram.p_improved);
}

void WriteParity(const residuals::ParityPoint& point, v1::ParityPoint* message) {
  message->set_simulated(Microseconds(point.simulated_s));
  message->set_measured(Microseconds(point.measured_s));
  message->set_improved(Microseconds(point.improved_s));
  message->set_finger(static_cast<uint32_t>(point.finger));
}

void WriteSurfacePoint(const residuals::SurfaceResidual& point, v1::SurfacePoint* message) {
  message->set_object(point.object);
  message->set_x_mm(point.contact_m.x() * kMillimetresPerMetre);
  message->set_y_mm(point.contact_m.y() * kMillimetresPerMetre);
  message->set_z_mm(point.contact_m.z() * kMillimetresPerMetre);
  message->set_residual(Microseconds(point.residual_s));
  message->set_after(Microseconds(point.improved_residual_s));
  message->set_finger(static_cast<uint32_t>(point.finger));
  message->set_std_uncertainty(Microseconds(point.std_uncertainty_s));
  message->set_beyond_measured(point.beyond_measured);
}

void WriteOutline(const residuals::DrawableObject& outline, v1::ObjectOutline* message) {
  message->set_object(outline.object);
  // Vertices are stored, drawn and sent in single precision.
  for (const Eigen::Vector3f& vertex : outline.mesh.vertices_m)
    for (int axis = 0; axis < 3; ++axis)
      message->add_vertices_mm(vertex[axis] * static_cast<float>(kMillimetresPerMetre));
  for (const auto& triangle : outline.mesh.triangles)
    for (const uint32_t corner : triangle) message->add_triangles(corner);
}

// Five significant digits: what a picture shows, in few bytes.
float Rounded(double value) {
  if (!std::isfinite(value) || value == 0) return static_cast<float>(value);
  const double step = std::pow(10.0, std::floor(std::log10(std::abs(value))) - 4);
  return static_cast<float>(std::round(value / step) * step);
}

void WriteVectors(const std::vector<Eigen::Vector3d>& vectors, double scale,
                  google::protobuf::RepeatedField<float>* message) {
  for (const Eigen::Vector3d& vector : vectors)
    for (int axis = 0; axis < 3; ++axis) message->Add(Rounded(scale * vector[axis]));
}

void WriteTable(const residuals::TouchTable& table, v1::TouchTable* message) {
  message->set_touches_in_all(static_cast<uint32_t>(table.touches_in_all));
  message->set_spacing_mm(table.spacing_m * kMillimetresPerMetre);
  *message->mutable_touch() = {table.touch.begin(), table.touch.end()};
  *message->mutable_object() = {table.object.begin(), table.object.end()};
  WriteVectors(table.target_m, kMillimetresPerMetre, message->mutable_target_mm());
  WriteVectors(table.approach, 1, message->mutable_approach());
  WriteVectors(table.lateral, 1, message->mutable_lateral());
  WriteVectors(table.contact_m, kMillimetresPerMetre, message->mutable_contact_mm());
  for (const double standoff_m : table.standoff_m)
    message->add_standoff_mm(Rounded(standoff_m * kMillimetresPerMetre));
  for (const double time_s : table.simulated_s) message->add_simulated(Rounded(Microseconds(time_s)));
  for (const double time_s : table.residual_s) message->add_residual(Rounded(Microseconds(time_s)));
  for (const double time_s : table.after_s) message->add_after(Rounded(Microseconds(time_s)));
  for (const residuals::TableCovariate& covariate : table.covariates) {
    v1::TouchTable::Covariate* column = message->add_covariates();
    column->set_name(covariate.name);
    column->set_unit(covariate.unit);
    *column->mutable_labels() = {covariate.labels.begin(), covariate.labels.end()};
    for (const double value : covariate.values) column->add_values(Rounded(value));
  }
  for (const std::vector<uint32_t>& cells : table.slice_cells)
    *message->add_slices()->mutable_cells() = {cells.begin(), cells.end()};
}

}  // namespace

void WriteTouches(const DataReport& data, v1::DataReport* message) {
  *message->mutable_fingers() = {data.fingers.begin(), data.fingers.end()};
  for (const double bias_s : data.finger_bias_s) message->add_finger_bias(Microseconds(bias_s));
  if (data.finger_scatter) {
    v1::FingerScatter* scatter = message->mutable_finger_scatter();
    scatter->set_finger(data.fingers[data.finger_scatter->finger]);
    scatter->set_rmse(Microseconds(data.finger_scatter->rmse_s));
    scatter->set_others_rmse(Microseconds(data.finger_scatter->others_rmse_s));
    scatter->set_p(data.finger_scatter->p_value);
  }
  for (const residuals::WorstTouch& touch : data.worst_touches)
    WriteWorstTouch(touch, message->add_worst_touches());
  for (const residuals::ComparedHistogram& histogram : data.histograms)
    WriteHistogram(histogram, message->add_histograms());
  for (const residuals::ParityPoint& point : data.parity) WriteParity(point, message->add_parity());
  for (const residuals::SurfaceResidual& point : data.surface_points)
    WriteSurfacePoint(point, message->add_surface_points());
  for (const residuals::DrawableObject& outline : data.outlines)
    WriteOutline(outline, message->add_outlines());
  if (data.table.size() > 0) WriteTable(data.table, message->mutable_touch_table());
}

}  // namespace touchstone::diagnosis::report
