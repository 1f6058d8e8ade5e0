#include "server/service/options/access_roles.h"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_replace.h>
#include <google/protobuf/descriptor.h>

#include <algorithm>

#include "server/base/text/text.h"

namespace touchstone::service {
namespace {

constexpr Role kNobody = Role::kNobody, kReader = Role::kReader, kOperator = Role::kOperator,
               kAdmin = Role::kAdmin;

}  // namespace

const char* RoleName(Role role) {
  switch (role) {
    case Role::kNobody:
      return "nobody";
    case Role::kReader:
      return "reader";
    case Role::kOperator:
      return "operator";
    case Role::kAdmin:
      break;
  }
  return "admin";
}

absl::StatusOr<Role> ParseRole(absl::string_view name) {
  for (const Role role : {Role::kReader, Role::kOperator, Role::kAdmin})
    if (name == RoleName(role)) return role;
  return absl::InvalidArgumentError(absl::StrCat(
      "'", name, "' is no role", DidYouMean(std::string(name), {"reader", "operator", "admin"})));
}

const std::vector<MethodRole>& MethodRoles() {
  static const std::vector<MethodRole> roles = {
      // method, at a virtual or recorded source, at a rig
      {"/touchstone.v1.Source/Describe", kReader, kReader},
      {"/touchstone.v1.Source/ListObjects", kReader, kReader},
      {"/touchstone.v1.Source/ExpandPlan", kReader, kReader},
      {"/touchstone.v1.Source/Touch", kReader, kOperator},
      {"/touchstone.v1.Source/Capture", kReader, kOperator},
      {"/touchstone.v1.Source/StreamDataset", kReader, kOperator},
      {"/touchstone.v1.Control/AcquireLease", kOperator, kOperator},
      {"/touchstone.v1.Control/RenewLease", kOperator, kOperator},
      {"/touchstone.v1.Control/ReleaseLease", kOperator, kOperator},
      // Whoever sees that something goes wrong may stop it; to let it move again takes an operator.
      {"/touchstone.v1.Control/Stop", kReader, kReader},
      {"/touchstone.v1.Control/Reset", kOperator, kOperator},
      {"/touchstone.v1.Control/GetState", kReader, kReader},
      {"/touchstone.v1.Models/ListEffects", kReader, kReader},
      {"/touchstone.v1.Models/ListModels", kReader, kReader},
      {"/touchstone.v1.Models/GetModel", kReader, kReader},
      {"/touchstone.v1.Models/CreateModel", kAdmin, kAdmin},
      {"/touchstone.v1.Sessions/CreateSession", kAdmin, kAdmin},
      {"/touchstone.v1.Sessions/ListSessions", kReader, kReader},
      {"/touchstone.v1.Sessions/GetSession", kReader, kReader},
      {"/touchstone.v1.Sessions/ExportSession", kReader, kReader},
      {"/touchstone.v1.Sessions/DeleteSession", kAdmin, kAdmin},
      {"/touchstone.v1.Sessions/RestoreSession", kAdmin, kAdmin},
      // They calculate from what is sent along and keep nothing; Diagnose with save_model, which does, asks for an admin itself.
      {"/touchstone.v1.Diagnosis/Compare", kReader, kReader},
      {"/touchstone.v1.Diagnosis/Diagnose", kReader, kReader},
      {"/touchstone.v1.Diagnosis/Propose", kReader, kReader},
      {"/touchstone.v1.Diagnosis/Check", kReader, kReader},
      {"/touchstone.v1.Diagnosis/Explain", kReader, kReader},
      {"/touchstone.v1.Diagnosis/Uncertainty", kReader, kReader},
      {"/touchstone.v1.Rig/GetRig", kReader, kReader},
      {"/touchstone.v1.Rig/CheckTouches", kReader, kReader},
      {"/touchstone.v1.Rig/CheckViews", kReader, kReader},
      {"/touchstone.v1.Rig/MountObject", kOperator, kOperator},
      {"/touchstone.v1.Rig/PowerOn", kOperator, kOperator},
      {"/touchstone.v1.Rig/Home", kOperator, kOperator},
      {"/touchstone.v1.Freedrive/Guide", kOperator, kOperator},
      // What balancers and tools ask before they have credentials: no data, only whether and what is served.
      {"/grpc.health.v1.Health/Check", kNobody, kNobody},
      {"/grpc.health.v1.Health/Watch", kNobody, kNobody},
      {"/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", kNobody, kNobody},
  };
  return roles;
}

std::optional<Role> RoleNeeded(absl::string_view method, Motion motion) {
  for (const MethodRole& row : MethodRoles())
    if (method == row.method) return motion == Motion::kRig ? row.rig : row.simulated;
  return std::nullopt;
}

absl::Status CheckRolesOf(const std::string& service) {
  const google::protobuf::ServiceDescriptor* const description =
      google::protobuf::DescriptorPool::generated_pool()->FindServiceByName(service);
  if (description == nullptr)
    return absl::InternalError(absl::StrCat("service ", service, " is not described"));
  std::string missing;
  for (int i = 0; i < description->method_count(); ++i) {
    const std::string method = absl::StrCat("/", service, "/", description->method(i)->name());
    if (!RoleNeeded(method, Motion::kRig).has_value()) absl::StrAppend(&missing, " ", method);
  }
  if (missing.empty()) return absl::OkStatus();
  return absl::InternalError(absl::StrCat("no role is given for", missing, ": add it in access_roles.cpp"));
}

std::string MethodName(absl::string_view method) {
  const size_t slash = method.rfind('/');
  if (slash == 0 || slash == absl::string_view::npos) return std::string(method);
  absl::string_view service = method.substr(0, slash);
  service.remove_prefix(service.find_last_of("./") + 1);
  return absl::StrCat(service, ".", method.substr(slash + 1));
}

}  // namespace touchstone::service
