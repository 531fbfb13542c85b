//! Who may talk to the server: the browser that was opened with the address it printed, and pages of nobody else.
//!
//! The first address carries a random token, which becomes a cookie that scripts cannot read. The names in `Host` and `Origin`
//! are checked against the server's own address, so that a foreign page that resolves its name to this machine (DNS
//! rebinding) gets nothing, and answers may run only scripts from here.

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderValue, Method, StatusCode, Uri, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use super::refused::refusal;

const COOKIE: &str = "quadlab_lab";
/// Plotly sets styles of elements; scripts come from this server only.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; \
                      connect-src 'self'; worker-src blob:; form-action 'none'; base-uri 'none'; frame-ancestors 'none'";

/// What the server lets in.
#[derive(Debug, Clone)]
pub(super) struct Guard {
    token: String,
    /// `127.0.0.1:PORT` and `localhost:PORT`.
    hosts: [String; 2],
}

impl Guard {
    /// With a new token.
    pub(super) fn new(port: u16) -> Result<Self, getrandom::Error> {
        let mut bytes = [0; 16];
        getrandom::fill(&mut bytes)?;
        let token = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(Self { token, hosts: [format!("127.0.0.1:{port}"), format!("localhost:{port}")] })
    }

    /// The address to open.
    pub(super) fn address(&self) -> String {
        format!("http://{}/?token={}", self.hosts[0], self.token)
    }

    fn is_own_host(&self, headers: &HeaderMap) -> bool {
        let host = headers.get(header::HOST).and_then(|host| host.to_str().ok());
        host.is_some_and(|host| self.hosts.iter().any(|own| own == host))
    }

    /// A request that changes something must come from a page of this server.
    fn is_own_origin(&self, headers: &HeaderMap) -> bool {
        let origin = headers.get(header::ORIGIN).and_then(|origin| origin.to_str().ok());
        origin
            .and_then(|origin| origin.strip_prefix("http://"))
            .is_some_and(|from| self.hosts.iter().any(|own| own == from))
    }

    /// What no form of another page can send without being asked first.
    fn is_of_a_script(headers: &HeaderMap) -> bool {
        let kind = headers.get(header::CONTENT_TYPE).and_then(|kind| kind.to_str().ok());
        let kind = kind.and_then(|kind| kind.split(';').next());
        kind.is_some_and(|kind| ["application/json", "application/octet-stream"].contains(&kind))
    }

    fn has_cookie(&self, headers: &HeaderMap) -> bool {
        let all = headers.get_all(header::COOKIE).iter().filter_map(|value| value.to_str().ok());
        let mut pairs = all.flat_map(|value| value.split(';')).filter_map(|pair| pair.trim().split_once('='));
        pairs.any(|(name, value)| name == self.cookie_name() && same(value, &self.token))
    }

    /// Cookies do not know ports: two labs on one machine have two names.
    fn cookie_name(&self) -> String {
        let port = self.hosts[0].rsplit(':').next().unwrap_or_default();
        format!("{COOKIE}_{port}")
    }

    fn has_token(&self, uri: &Uri) -> bool {
        let mut pairs = uri.query().unwrap_or_default().split('&').filter_map(|pair| pair.split_once('='));
        uri.path() == "/" && pairs.any(|(name, value)| name == "token" && same(value, &self.token))
    }

    fn why_refused(&self, request: &Request) -> Option<&'static str> {
        let headers = request.headers();
        if !self.is_own_host(headers) {
            return Some(
                "this server answers to 127.0.0.1 and localhost only: open the address that quadlab printed",
            );
        }
        if !self.has_cookie(headers) {
            return Some(
                "this browser has not been let in: open the address with the token that quadlab printed",
            );
        }
        let changes = request.method() != Method::GET && request.method() != Method::HEAD;
        if changes && !(self.is_own_origin(headers) && Self::is_of_a_script(headers)) {
            return Some(
                "only the lab's own page may change something: open the address that quadlab printed",
            );
        }
        None
    }
}

/// Compares without telling by the time it takes how many letters are right.
fn same(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |differ, (a, b)| differ | (a ^ b)) == 0
}

/// Lets a request through or not, and says in every answer what a page may do.
pub(super) async fn check(State(guard): State<Guard>, request: Request, next: Next) -> Response {
    let mut response = if guard.is_own_host(request.headers()) && guard.has_token(request.uri()) {
        let cookie = format!("{}={}; HttpOnly; SameSite=Strict; Path=/", guard.cookie_name(), guard.token);
        (StatusCode::SEE_OTHER, [(header::LOCATION, "/".to_owned()), (header::SET_COOKIE, cookie)])
            .into_response()
    } else if let Some(why) = guard.why_refused(&request) {
        refusal(StatusCode::FORBIDDEN, why)
    } else {
        next.run(request).await
    };
    let headers = response.headers_mut();
    for (name, value) in [
        (header::CONTENT_SECURITY_POLICY, POLICY),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::X_FRAME_OPTIONS, "DENY"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    if !headers.contains_key(header::CACHE_CONTROL) {
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    }
    response
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::body::Body;

    fn guard() -> Guard {
        Guard::new(4321).unwrap()
    }

    fn request(guard: &Guard, method: &str, change: impl FnOnce(&mut HeaderMap)) -> Request {
        let mut request = Request::builder().method(method).uri("/api/state").body(Body::empty()).unwrap();
        let headers = request.headers_mut();
        let mut set = |name, value: String| headers.insert(name, HeaderValue::from_str(&value).unwrap());
        set(header::HOST, "127.0.0.1:4321".into());
        set(header::COOKIE, format!("other=1; {}={}", guard.cookie_name(), guard.token));
        set(header::ORIGIN, "http://127.0.0.1:4321".into());
        set(header::CONTENT_TYPE, "application/json; charset=utf-8".into());
        change(headers);
        request
    }

    #[test]
    fn only_the_browser_that_has_the_token_and_its_own_page_get_in() {
        let guard = guard();
        let put = |name: header::HeaderName, value: &'static str| {
            move |headers: &mut HeaderMap| {
                headers.insert(name.clone(), HeaderValue::from_static(value));
            }
        };
        let refused = |method: &str, change: &dyn Fn(&mut HeaderMap)| {
            guard.why_refused(&request(&guard, method, |headers| change(headers))).is_some()
        };
        assert!(!refused("GET", &|_| ()) && !refused("POST", &|_| ()));
        assert!(refused("GET", &put(header::HOST, "evil.example:4321")));
        assert!(refused("GET", &put(header::HOST, "127.0.0.1:4322")));
        assert!(refused("GET", &put(header::COOKIE, "quadlab_lab_4321=00")));
        assert!(refused("GET", &|headers| _ = headers.remove(header::COOKIE)));
        assert!(refused("POST", &put(header::ORIGIN, "http://evil.example")));
        assert!(refused("POST", &|headers| _ = headers.remove(header::ORIGIN)));
        assert!(refused("POST", &put(header::CONTENT_TYPE, "text/plain")));
    }

    #[test]
    fn tokens_are_long_and_each_is_another() {
        let (one, other) = (guard(), guard());
        assert!(one.token.len() == 32 && one.token != other.token);
        assert!(one.has_token(&format!("/?token={}", one.token).parse().unwrap()));
        assert!(!one.has_token(&format!("/?token={}", other.token).parse().unwrap()));
        assert!(!one.has_token(&format!("/api/state?token={}", one.token).parse().unwrap()));
    }
}
