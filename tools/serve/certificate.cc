// SPDX-License-Identifier: LGPL-2.1-or-later
#include "certificate.h"

#include <openssl/pem.h>
#include <openssl/x509.h>
#include <sys/stat.h>

#include <memory>
#include <utility>

#include "base/error.h"
#include "base/json_value.h"
#include "base/secret_file.h"

namespace lf::serve {
namespace {

using BioPtr = std::unique_ptr<BIO, decltype(&BIO_free)>;

BioPtr bio_of(const std::string& text) {
  return BioPtr(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())), BIO_free);
}

// GLib takes any two files, and would fail every handshake.
void check_pair(const std::string& certificate_file, const std::string& certificate, const std::string& key_file,
                const std::string& key) {
  const BioPtr first = bio_of(certificate), second = bio_of(key);
  // Without this OpenSSL asks the terminal for a passphrase.
  const auto no_passphrase = [](char*, int, int, void*) { return 0; };
  const std::unique_ptr<X509, decltype(&X509_free)> x509(
      PEM_read_bio_X509(first.get(), nullptr, no_passphrase, nullptr), X509_free);
  const std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)> secret(
      PEM_read_bio_PrivateKey(second.get(), nullptr, no_passphrase, nullptr), EVP_PKEY_free);
  if (!x509) throw Error(certificate_file + ": has no certificate in PEM format");
  if (!secret) throw Error(key_file + ": has no private key in PEM format without a passphrase");
  if (X509_check_private_key(x509.get(), secret.get()) != 1)
    throw Error(key_file + ": is not the key of the certificate in " + certificate_file);
}

GTlsCertificate* load(const std::string& certificate_file, const std::string& key_file) {
  const std::string certificate = read_text_file(certificate_file);
  std::string key = read_secret_file(key_file);
  check_pair(certificate_file, certificate, key_file, key);
  std::string both = certificate + "\n" + key;
  g_autoptr(GError) error = nullptr;
  GTlsCertificate* loaded = g_tls_certificate_new_from_pem(both.data(), static_cast<gssize>(both.size()), &error);
  wipe(key);
  wipe(both);
  if (!loaded) throw Error(certificate_file + ": " + error->message);
  return loaded;
}

}  // namespace

Certificate::Version Certificate::version_of(const std::string& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) return {};
  return {static_cast<int64_t>(status.st_ino), status.st_size, status.st_mtim.tv_sec, status.st_mtim.tv_nsec};
}

Certificate::Certificate(std::string certificate_file, std::string key_file)
    : certificate_file_(std::move(certificate_file)),
      key_file_(std::move(key_file)),
      read_{version_of(certificate_file_), version_of(key_file_)},
      certificate_(load(certificate_file_, key_file_)) {}

bool Certificate::reload() {
  const std::array now = {version_of(certificate_file_), version_of(key_file_)};
  if (now == read_) return false;
  read_ = now;
  GTlsCertificate* loaded = load(certificate_file_, key_file_);
  g_object_unref(certificate_);
  certificate_ = loaded;
  return true;
}

}  // namespace lf::serve
