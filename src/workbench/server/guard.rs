//! Access control. A request must have the token of this program, and its headers must not name a foreign host or page. A
//! request without an `Origin` header (from a program such as curl) is allowed too if it has the token.

use axum::extract::{Request, State};
use axum::http::header::{
    AUTHORIZATION, CACHE_CONTROL, CONTENT_SECURITY_POLICY, COOKIE, HOST, LOCATION, ORIGIN,
    REFERRER_POLICY, SET_COOKIE, X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};

use super::Shared;
use super::routes::failure;

/// Content security policy: a page may load only files of this program, and no inline scripts.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; \
                      img-src 'self' data:; base-uri 'none'; form-action 'self'; frame-ancestors 'none'";

/// Forwards a request that has the token and whose `Host` and, if present, `Origin` are this program's address. Refuses others.
pub async fn guard(State(shared): State<Shared>, request: Request, next: Next) -> Response {
    let answer = match allowed(&shared, &request) {
        Ok(Entry::Known) => next.run(request).await,
        Ok(Entry::New(cookie)) => {
            // the redirect removes the token from the address bar
            let headers = [(SET_COOKIE, cookie), (LOCATION, "/".to_owned())];
            (StatusCode::SEE_OTHER, headers).into_response()
        }
        Err(answer) => *answer,
    };
    safe(answer)
}

/// Place of the token in an allowed request.
enum Entry {
    /// The token is in the cookie or in a header.
    Known,
    /// The token is in the address. The answer sets this cookie.
    New(String),
}

fn allowed(shared: &Shared, request: &Request) -> Result<Entry, Box<Response>> {
    let headers = request.headers();
    let port = shared.address.port();
    let hosts = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
    let text = |name| headers.get(name).and_then(|v: &HeaderValue| v.to_str().ok());
    // this refuses a foreign host name that resolves to this computer, and requests from a page of another site
    let host = text(HOST).is_some_and(|h| hosts.iter().any(|own| own == h));
    let origin = text(ORIGIN).is_none_or(|o| hosts.iter().any(|own| o == format!("http://{own}")));
    if !host || !origin {
        let why = "the workbench answers only its own page on this machine";
        return Err(Box::new(failure(StatusCode::FORBIDDEN, why)));
    }
    let name = format!("greylag-{port}");
    if cookie(headers, &name).is_some_and(|c| same(c, &shared.token)) {
        return Ok(Entry::Known);
    }
    let bearer = text(AUTHORIZATION).and_then(|a| a.strip_prefix("Bearer "));
    if bearer.is_some_and(|b| same(b, &shared.token)) {
        return Ok(Entry::Known);
    }
    let query = request.uri().query().unwrap_or_default();
    let token = query.split('&').find_map(|pair| pair.strip_prefix("token="));
    if request.uri().path() == "/" && token.is_some_and(|t| same(t, &shared.token)) {
        let token = &shared.token;
        return Ok(Entry::New(format!("{name}={token}; Path=/; HttpOnly; SameSite=Strict")));
    }
    let why = "wrong or missing token: open the address that `greylag workbench` printed";
    Err(Box::new(failure(StatusCode::UNAUTHORIZED, why)))
}

/// Value of the cookie `name`; `None` if it is not set.
fn cookie<'a>(headers: &'a HeaderMap, name: &str) -> Option<&'a str> {
    let all = headers.get_all(COOKIE).into_iter().filter_map(|v| v.to_str().ok());
    all.flat_map(|line| line.split("; ")).find_map(|pair| {
        let (own, value) = pair.split_once('=')?;
        (own == name).then_some(value)
    })
}

/// Whether two tokens are equal. The time of the comparison does not depend on the position of a difference.
fn same(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |off, (a, b)| off | (a ^ b)) == 0
}

/// Adds the security headers of every answer.
fn safe(mut answer: Response) -> Response {
    let headers = answer.headers_mut();
    for (name, value) in [
        (CONTENT_SECURITY_POLICY, POLICY),
        (X_CONTENT_TYPE_OPTIONS, "nosniff"),
        (REFERRER_POLICY, "no-referrer"),
        (CACHE_CONTROL, "no-store"),
    ] {
        headers.insert(name, HeaderValue::from_static(value));
    }
    answer
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_and_cookies_are_compared_whole() {
        assert!(same("abc", "abc") && !same("abc", "abd") && !same("ab", "abc") && !same("", "a"));
        let mut headers = HeaderMap::new();
        headers.insert(COOKIE, HeaderValue::from_static("a=1; greylag-80=xyz; b=2"));
        assert_eq!(cookie(&headers, "greylag-80"), Some("xyz"));
        assert_eq!(cookie(&headers, "greylag-8"), None);
    }
}
