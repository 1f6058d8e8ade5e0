// What it takes to make the report again, and to know that it is the same.
#include <absl/strings/str_cat.h>

#include "client/report/html_page.h"
#include "client/report/words.h"

namespace touchstone::client {
namespace {

constexpr int kColumns = 96;

std::string Hash(const std::string& hex) {
  return hex.empty()
             ? ""
             : absl::StrCat("<code title=\"", Escape(hex), "\">", Escape(hex.substr(0, 16)), "</code>");
}

std::string MeshTable(const v1::Provenance& provenance) {
  if (provenance.meshes().empty()) return "";
  std::string table = absl::StrCat(
      "<div class=\"scroll\"><table>",
      HeaderRow({"Object", "Mesh file", "SHA-256 of the file", "Hash of the geometry"}), "<tbody>");
  for (const v1::MeshProvenance& mesh : provenance.meshes())
    absl::StrAppend(&table, "<tr>", Cell(Escape(mesh.object()), "name"),
                    Cell(mesh.path().empty() ? "of the server" : Escape(mesh.path())),
                    Cell(Hash(mesh.file_sha256())), Cell(Hash(mesh.mesh_hash())), "</tr>");
  return table + "</tbody></table></div>\n";
}

}  // namespace

std::string HtmlProvenance(const v1::Report& report) {
  if (!report.has_provenance()) return "";
  const v1::Provenance& provenance = report.provenance();
  std::string body;
  if (!provenance.command().empty())
    body =
        absl::StrCat("<div class=\"row\"><button type=\"button\" data-copy=\"command\">Copy</button></div>\n",
                     "<pre id=\"command\">", Escape(ShellLines(provenance.command(), kColumns)), "</pre>\n");
  std::string terms;
  const auto add = [&terms](const char* term, const std::string& html) {
    if (!html.empty()) absl::StrAppend(&terms, "<dt>", term, "</dt><dd>", html, "</dd>");
  };
  add("Made", Escape(provenance.date()));
  add("Version", report.version() == provenance.client_version() || provenance.client_version().empty()
                     ? Escape(report.version())
                     : Escape(absl::StrCat(report.version(), " of the server, ", provenance.client_version(),
                                           " of the client")));
  add("Seed", absl::StrCat(provenance.seed()));
  add("Set", provenance.set_sha256().empty() ? ""
                                             : absl::StrCat(Escape(MainData(report).session()), ", SHA-256 ",
                                                            Hash(provenance.set_sha256())));
  add("Model", report.model_hash().empty()
                   ? ""
                   : absl::StrCat(Escape(report.model_name()), ", hash ", Hash(report.model_hash())));
  absl::StrAppend(&body, "<dl>", terms, "</dl>\n", MeshTable(provenance));
  return Section(
      "provenance", "How to make this report again",
      "The same files, model, seed and version give the same numbers. Hashes in full are in the JSON "
      "report, and where the mouse rests on one.",
      body);
}

}  // namespace touchstone::client
