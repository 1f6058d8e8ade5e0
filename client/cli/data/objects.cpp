// touchstone objects: what can be touched.
#include "client/cli/common/common.h"
#include "client/source/dataset/lab_units.h"
#include "server/base/status.h"

namespace touchstone::cli {
namespace {

double Millimetres(double metres) {
  return client::LabNumber(Unit::kMillimetre, metres);
}

Json VectorMm(const v1::Vector3& v) {
  return {Millimetres(v.x()), Millimetres(v.y()), Millimetres(v.z())};
}

absl::Status RunObjects(const Cli& cli) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const auto connection, cli.Connect());
  TOUCHSTONE_ASSIGN_OR_RETURN(const v1::ListObjectsResponse response,
                              connection->Call(&v1::Source::Stub::ListObjects, v1::ListObjectsRequest()));
  if (cli.output().json) {
    Json list = Json::array();
    for (const v1::Object& object : response.objects())
      list.push_back({{"name", object.name()},
                      {"vertices", object.vertices()},
                      {"triangles", object.triangles()},
                      {"bounds_min_mm", VectorMm(object.bounds_min_m())},
                      {"bounds_max_mm", VectorMm(object.bounds_max_m())},
                      {"closed", object.closed()},
                      {"mesh_hash", object.mesh_hash()},
                      {"origin", object.origin()}});
    PrintJson({{"objects", list}});
    return absl::OkStatus();
  }
  Table table({"OBJECT", "TRIANGLES", "SIZE (MM)", "CLOSED", "MESH HASH", "ORIGIN"});
  for (const v1::Object& object : response.objects()) {
    const auto side = [](double low_m, double high_m) { return Rounded(Millimetres(high_m - low_m)); };
    const v1::Vector3& low = object.bounds_min_m();
    const v1::Vector3& high = object.bounds_max_m();
    table.Add({object.name(), std::to_string(object.triangles()),
               absl::StrCat(side(low.x(), high.x()), " x ", side(low.y(), high.y()), " x ",
                            side(low.z(), high.z())),
               object.closed() ? "yes" : "no", object.mesh_hash().substr(0, 12), object.origin()});
  }
  return cli.Print(table.Text());
}

}  // namespace

void AddObjects(Cli* cli) {
  CLI::App* command = cli->AddCommand(nullptr, "objects", "Lists what can be touched.",
                                      "touchstone objects\n"
                                      "touchstone objects --mesh cup=cup.off,fit_mm=150\n"
                                      "touchstone objects --server 127.0.0.1:50051 --json",
                                      [cli] { return RunObjects(*cli); });
  cli->AddSourceOptions(command);
}

}  // namespace touchstone::cli
