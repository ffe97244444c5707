# The formula for Homebrew. Version and hash change with each release.
class Snell < Formula
  desc "Ray caster and physically based renderer"
  homepage "https://github.com/snell-render/snell"
  url "https://github.com/snell-render/snell/archive/refs/tags/v0.1.0.tar.gz"
  sha256 "0000000000000000000000000000000000000000000000000000000000000000"
  license any_of: ["MIT", "Apache-2.0"]

  depends_on "rust" => :build

  def install
    system "cargo", "install", *std_cargo_args(path: "crates/cli")
    system "cargo", "rustc", "--release", "--locked", "--package", "snell-capi",
           "--crate-type", "cdylib,staticlib"
    lib.install Dir["target/release/libsnell.{a,dylib,so}"]
    include.install "crates/capi/include/snell.h"
    generate_completions_from_executable(bin/"snell", "completions")
    (man1/"snell.1").write Utils.safe_popen_read(bin/"snell", "man")
  end

  test do
    system bin/"snell", "render", "cornell-box", "--spp", "1", "--size", "32x24"
    assert_path_exists testpath/"cornell-box.png"
  end
end
