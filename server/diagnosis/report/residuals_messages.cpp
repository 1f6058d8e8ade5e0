#include "server/diagnosis/report/residuals_messages.h"

#include "server/base/units.h"
#include "server/session/measurement_set.h"

namespace touchstone::diagnosis::report {
namespace {

const char* NameOf(residuals::ErrorGroupKind kind) {
  switch (kind) {
    case residuals::ErrorGroupKind::kObject:
      return "object";
    case residuals::ErrorGroupKind::kFace:
      return "face";
    case residuals::ErrorGroupKind::kFinger:
      return "finger";
    case residuals::ErrorGroupKind::kRound:
      return "round";
    case residuals::ErrorGroupKind::kTime:
      return "time";
    case residuals::ErrorGroupKind::kSpeed:
      return "speed";
  }
  return "";
}

void WriteSlice(const residuals::ErrorSlice& slice, v1::Slice* message) {
  message->set_slice(slice.conditions);
  message->set_touches(static_cast<uint32_t>(slice.touches));
  message->set_mean_residual_us(Microseconds(slice.mean_residual_s));
  message->set_rmse_us(Microseconds(slice.rmse_s));
  message->set_share_of_excess_error(slice.share_of_excess_error);
  message->set_words(slice.words);
}

void WriteGroup(const residuals::ErrorGroup& group, v1::GroupError* message) {
  message->set_kind(NameOf(group.kind));
  message->set_name(group.name);
  message->set_touches(static_cast<uint32_t>(group.touches));
  message->set_rmse_us(Microseconds(group.rmse_s));
  message->set_mean_residual_us(Microseconds(group.mean_residual_s));
  message->set_share_of_excess_error(group.share_of_excess_error);
}

void WriteWorstTouch(const residuals::WorstTouch& touch, v1::TouchError* message) {
  message->set_touch(touch.touch);
  message->set_object(touch.object);
  message->set_norm_us(Microseconds(touch.norm_s));
  for (const double residual_s : touch.residual_s) message->add_residual_us(Microseconds(residual_s));
}

void WriteCurve(const residuals::ResidualCurve& curve, int fingers, v1::CovariateCurve* message) {
  message->set_covariate(curve.covariate);
  message->set_unit(curve.unit);
  message->set_p(curve.p_value);
  message->set_p_after(curve.improved_p_value);
  for (const residuals::FingerDependence& own : curve.fingers) {
    v1::FingerDependence* finger = message->add_fingers();
    finger->set_finger(model::FingerName(own.finger, fingers));
    finger->set_p(own.p_value);
    finger->set_p_after(own.improved_p_value);
  }
  for (const residuals::ResidualCurveBin& bin : curve.bins) {
    v1::CurveBin* bin_message = message->add_bins();
    bin_message->set_finger(model::FingerName(bin.finger, fingers));
    bin_message->set_centre(bin.centre);
    bin_message->set_count(static_cast<uint32_t>(bin.touches));
    bin_message->set_mean_residual_us(Microseconds(bin.mean_residual_s));
    bin_message->set_std_error_us(Microseconds(bin.std_error_s));
    bin_message->set_after_us(Microseconds(bin.improved_mean_residual_s));
  }
}

void WriteParity(const residuals::ParityPoint& point, v1::ParityPoint* message) {
  message->set_simulated_us(Microseconds(point.simulated_s));
  message->set_measured_us(Microseconds(point.measured_s));
  message->set_improved_us(Microseconds(point.improved_s));
  message->set_finger(static_cast<uint32_t>(point.finger));
}

void WriteSurfacePoint(const residuals::SurfaceResidual& point, v1::SurfacePoint* message) {
  message->set_object(point.object);
  message->set_x_mm(point.contact_m.x() * kMillimetresPerMetre);
  message->set_y_mm(point.contact_m.y() * kMillimetresPerMetre);
  message->set_z_mm(point.contact_m.z() * kMillimetresPerMetre);
  message->set_residual_us(Microseconds(point.residual_s));
  message->set_after_us(Microseconds(point.improved_residual_s));
  message->set_finger(static_cast<uint32_t>(point.finger));
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

}  // namespace

void WriteHistogram(const residuals::ComparedHistogram& histogram, v1::Report* report) {
  v1::Histogram* message = report->add_histograms();
  message->set_quantity(histogram.quantity == residuals::HistogramQuantity::kDescriptor ? "descriptor_us"
                                                                                        : "curvature_per_m");
  message->set_object(histogram.object);
  *message->mutable_edges() = {histogram.edges.begin(), histogram.edges.end()};
  *message->mutable_measured() = {histogram.measured.begin(), histogram.measured.end()};
  *message->mutable_simulated() = {histogram.simulated.begin(), histogram.simulated.end()};
  *message->mutable_improved() = {histogram.improved.begin(), histogram.improved.end()};
  message->set_p_simulated(histogram.p_simulated);
  message->set_p_improved(histogram.p_improved);
}

void WriteResiduals(const residuals::ResidualSummary& residuals, int fingers, v1::Report* report) {
  for (const residuals::ErrorSlice& slice : residuals.slices) WriteSlice(slice, report->add_where());
  for (const residuals::ErrorGroup& group : residuals.grouped.groups) WriteGroup(group, report->add_groups());
  for (const double bias_s : residuals.grouped.finger_bias_s)
    report->add_finger_bias_us(Microseconds(bias_s));
  if (residuals.finger_scatter) {
    v1::FingerScatter* message = report->mutable_finger_scatter();
    message->set_finger(model::FingerName(residuals.finger_scatter->finger, fingers));
    message->set_rmse_us(Microseconds(residuals.finger_scatter->rmse_s));
    message->set_others_rmse_us(Microseconds(residuals.finger_scatter->others_rmse_s));
    message->set_p(residuals.finger_scatter->p_value);
  }
  for (const residuals::WorstTouch& touch : residuals.worst_touches)
    WriteWorstTouch(touch, report->add_worst_touches());
  for (const residuals::ResidualCurve& curve : residuals.curves)
    WriteCurve(curve, fingers, report->add_curves());
  for (const residuals::ComparedHistogram& histogram : residuals.histograms)
    WriteHistogram(histogram, report);
  for (const residuals::ParityPoint& point : residuals.parity) WriteParity(point, report->add_parity());
  for (const residuals::SurfaceResidual& point : residuals.surface_points)
    WriteSurfacePoint(point, report->add_surface_points());
  for (const residuals::DrawableObject& outline : residuals.outlines)
    WriteOutline(outline, report->add_outlines());
}

}  // namespace touchstone::diagnosis::report
